"""Waveforms of dynamic tests go out to other programs' files and come back equal; files that lack what is needed are refused."""

from pathlib import Path

import numpy as np
import pytest
from in_process import document_of
from long_suites import mostly_slow

from pipelines.archive import Archive
from pipelines.cli.export import WAVEFORMS as FORMATS
from pipelines.export.waveforms import WRITERS, Channel, write_waveforms
from pipelines.importers import files
from pipelines.importers.waveforms import RecordingLayout, import_waveforms
from schemas.errors import DataRejected, WrongUse

RATE, DURATION = 50_000.0, 0.011
SHOCK = 'effects = ["delay"]\nscale = 0.007\nfull_scale = 0.5\n'


def shock(sign: float, rng: np.random.Generator, unit_gain: float = 1.01) -> list[Channel]:
    """A half sine of 30 g on reference and unit, with noise and a delay of 60 µs."""
    time = np.arange(round(0.2 * RATE)) / RATE - 0.06

    def pulse(late: float) -> np.ndarray:
        t = time - late
        return np.where((t > 0.0) & (t < DURATION), sign * 30.0 * np.sin(np.pi * t / DURATION), 0.0)

    reference = pulse(0.0) + 2e-3 * rng.normal(size=time.size)
    output = 0.007 * (1.0 + unit_gain * pulse(60e-6) + 1e-3 * rng.normal(size=time.size))
    return [
        Channel("unit z", "V", "units", output, 1.0 / RATE, 2),
        Channel("reference z", "g", "reference", reference, 1.0 / RATE, 2),
    ]


def test_two_clocks_are_two_files_where_a_format_has_one(tmp_path: Path, rng: np.random.Generator) -> None:
    unit, reference = shock(1.0, rng)
    slow = Channel(unit.name, unit.unit, unit.group, unit.samples[::5], 5.0 / RATE, 2)
    written = write_waveforms("csv", [slow, reference], tmp_path / "two.csv")
    assert [path.name for path in written] == ["two_units.csv", "two_reference.csv"]
    assert write_waveforms("uff58", [slow, reference], tmp_path / "two.uff") == [tmp_path / "two.uff"]
    assert ", ".join(WRITERS) == FORMATS
    with pytest.raises(WrongUse, match="no format is called"):
        write_waveforms("udf", [reference], tmp_path / "x")


@pytest.mark.parametrize("form", mostly_slow(["csv", "tdms", "mat"], "tdms"))
def test_shocks_of_others_give_figures_and_a_verdict(form: str, tmp_path: Path, rng: np.random.Generator) -> None:
    paths = [tmp_path / f"shock{k}{WRITERS[form].suffix}" for k in range(4)]
    for k, path in enumerate(paths):
        write_waveforms(form, shock((-1.0) ** k, rng), path)
    part = tmp_path / "part.toml"
    part.write_text(SHOCK)
    group = "units,reference" if form == "tdms" else ""
    content, _ = files.read_content(paths[0], group.partition(",")[0])
    names = [str(name) for name in content.table.columns]
    unit = next(name for name in names if name.startswith(("unit", "channel 1")))
    reference = next((name for name in names if name.startswith(("reference", "channel 2"))), "reference z")
    columns = {"z": unit, "reference": reference}
    units = {"output": "V", "reference": "g"}
    if form == "mat":
        columns["time"], units["time"] = "time", "s"
    document = import_waveforms(
        paths, "shock", part, "S1", RecordingLayout(columns, units, None, group), str(tmp_path / "archive")
    )
    figures = {one["figure"]: one for one in document["figures"]}
    assert figures["shock_sensitivity_percent"]["value"] == pytest.approx(1.0, abs=0.1)
    assert not figures["shock_bias_shift_ug"]["identified"]
    assert any("sensitivity + delay is adequate" in line for line in document["text"])
    run = Archive(str(tmp_path / "archive")).run(document["run"])
    assert len(run.about["sources"]) == 4
    assert not run.table("procedure_points").empty


def test_a_file_without_unit_or_sample_interval_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    unit, reference = shock(1.0, rng)
    rows = "\n".join(f"{a:.9g},{b:.9g}" for a, b in zip(unit.samples, reference.samples, strict=True))
    bare = tmp_path / "bare.csv"
    bare.write_text(f"dut,ref\n{rows}\n")
    (part := tmp_path / "part.toml").write_text("scale = 0.3\n")
    columns = {"z": "dut", "reference": "ref"}
    with pytest.raises(DataRejected, match=r"bare.csv: column 'dut' has no unit.*--unit-of output"):
        import_waveforms([bare], "shock", part, "S1", RecordingLayout(columns, {}), str(tmp_path / "a"))
    units = {"output": "V", "reference": "g"}
    with pytest.raises(DataRejected, match=r"no sample interval is stated.*--rate"):
        import_waveforms([bare], "shock", part, "S1", RecordingLayout(columns, units), str(tmp_path / "a"))
    layout = RecordingLayout(columns, units | {"reference": "psi"}, RATE)
    with pytest.raises(DataRejected, match=r"reference in 'psi'"):
        import_waveforms([bare], "shock", part, "S1", layout, str(tmp_path / "a"))
    stated = tmp_path / "stated.csv"
    stated.write_text(f"dut [V],ref [g]\n{rows}\n")
    layout = RecordingLayout({"z": "dut [V]", "reference": "ref [g]"}, {"output": "mV"}, RATE)
    with pytest.raises(WrongUse, match=r"states V, --unit-of has mV"):
        import_waveforms([stated], "shock", part, "S1", layout, str(tmp_path / "a"))
    with pytest.raises(WrongUse, match="can be imported"):
        import_waveforms([bare], "tilt", None, "S1", RecordingLayout(columns, units, RATE), str(tmp_path / "a"))
    assert not (tmp_path / "a").exists() or not Archive(str(tmp_path / "a")).runs()


@pytest.mark.slow
def test_dwells_and_steps_of_others_are_imported_by_the_command(tmp_path: Path, rng: np.random.Generator) -> None:
    paths = []
    for k, frequency in enumerate(np.geomspace(20.0, 4000.0, 8)):
        t = np.arange(round(max(0.1, 20.0 / frequency) * RATE)) / RATE
        r = frequency / 2000.0
        h = 0.3 / (1.0 - r**2 + 1.3j * r)
        unit = np.real(h * np.exp(2j * np.pi * frequency * t)) + 1e-4 * rng.normal(size=t.size)
        reference = 9.80665 * np.cos(2.0 * np.pi * frequency * t) + 1e-3 * rng.normal(size=t.size)
        made = [
            Channel("dut", "V", "units", unit, 1.0 / RATE, 2),
            Channel("ref", "m/s^2", "reference", reference, 1.0 / RATE, 2),
        ]
        paths += write_waveforms("csv", made, tmp_path / f"dwell{k}.csv")
    part = tmp_path / "part.toml"
    part.write_text('nominal_scale = 0.3\neffects = ["second_order"]\nfull_scale = 5.0\n')
    words = ("--procedure", "sweep", "--set", part, "--map", "z=dut [V],reference=ref [m/s^2]", "--units", "W1")
    document = document_of("import", *paths, *words, "--archive", tmp_path / "archive")
    figures = {one["figure"]: one["value"] for one in document["figures"]}
    assert figures["sweep_natural_hz"] == pytest.approx(2000.0, rel=0.01)
    assert figures["sweep_damping"] == pytest.approx(0.65, abs=0.01)


def test_the_same_files_at_another_rate_are_another_run(tmp_path: Path, rng: np.random.Generator) -> None:
    paths = [tmp_path / f"shock{k}.csv" for k in range(4)]
    for k, path in enumerate(paths):
        channels = shock((-1.0) ** k, rng)
        rows = np.column_stack([one.samples for one in channels])
        np.savetxt(path, rows, delimiter=",", header="dut,ref", comments="")
    part, archive = tmp_path / "part.toml", str(tmp_path / "archive")
    part.write_text(SHOCK)
    columns, values = {"z": "dut", "reference": "ref"}, []
    for rate in (RATE, 0.9 * RATE):
        layout = RecordingLayout(columns, {"output": "V", "reference": "g"}, rate)
        document = import_waveforms(paths, "shock", part, "S1", layout, archive)
        kept = Archive(archive).run(document["run"]).table("procedure_figures").set_index("figure")["value"]
        shown = {one["figure"]: one["value"] for one in document["figures"] if one["identified"]}
        assert all(kept[name] == pytest.approx(value) for name, value in shown.items())
        values.append(document["run"])
    assert values[0] != values[1]
