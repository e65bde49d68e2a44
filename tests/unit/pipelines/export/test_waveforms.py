"""Waveforms of dynamic tests go out to other programs' files and come back equal; files that lack what is needed are refused."""

from pathlib import Path

import numpy as np
import pytest
from in_process import document_of

from pipelines.archive import Archive
from pipelines.cli.export import WAVEFORMS as FORMATS
from pipelines.export.waveforms import WRITERS, Channel, write_waveforms
from pipelines.importers.waveforms import RecordingLayout, import_waveforms
from schemas.errors import DataRejected, WrongUse

RATE, DURATION = 50_000.0, 0.011
UNITS = {"output": "V", "reference": "g"}
SHOCK = 'effects = ["delay"]\nscale = 0.007\nfull_scale = 0.5\n'


def shock(sign: float, rng: np.random.Generator, unit_gain: float = 1.01) -> list[Channel]:
    """A half sine of 30 g on reference and unit, with noise and a delay of 60 µs."""
    time = np.arange(round(0.2 * RATE)) / RATE - 0.06

    def pulse(late: float) -> np.ndarray:
        t = time - late
        return np.where((t > 0.0) & (t < DURATION), sign * 30.0 * np.sin(np.pi * t / DURATION), 0.0)

    reference = pulse(0.0) + 2e-3 * rng.normal(size=time.size)
    output = 0.007 * (1.0 + unit_gain * pulse(60e-6) + 1e-3 * rng.normal(size=time.size))
    made = ("unit z", "V", "units", output), ("reference z", "g", "reference", reference)
    return [Channel(*one, 1.0 / RATE, 2) for one in made]


def test_two_clocks_are_two_files_where_a_format_has_one(tmp_path: Path, rng: np.random.Generator) -> None:
    unit, reference = shock(1.0, rng)
    slow = Channel(unit.name, unit.unit, unit.group, unit.samples[::5], 5.0 / RATE, 2)
    written = write_waveforms("csv", [slow, reference], tmp_path / "two.csv")
    assert [path.name for path in written] == ["two_units.csv", "two_reference.csv"]
    assert write_waveforms("uff58", [slow, reference], tmp_path / "two.uff") == [tmp_path / "two.uff"]
    assert ", ".join(WRITERS) == FORMATS
    with pytest.raises(WrongUse, match="no format is called"):
        write_waveforms("udf", [reference], tmp_path / "x")


def test_shocks_of_others_in_two_groups_give_figures_and_a_verdict(tmp_path: Path, rng: np.random.Generator) -> None:
    paths = [tmp_path / f"shock{k}.tdms" for k in range(4)]
    for k, path in enumerate(paths):
        write_waveforms("tdms", shock((-1.0) ** k, rng), path)
    part, archive = tmp_path / "part.toml", str(tmp_path / "archive")
    part.write_text(SHOCK)
    layout = RecordingLayout({"z": "unit z", "reference": "reference z"}, UNITS, None, "units,reference")
    document = import_waveforms(paths, "shock", part, "S1", layout, archive)
    figures = {one["figure"]: one for one in document["figures"]}
    assert figures["shock_sensitivity_percent"]["value"] == pytest.approx(1.0, abs=0.1)
    assert not figures["shock_bias_shift_ug"]["identified"]
    assert any("sensitivity + delay is adequate" in line for line in document["text"])
    run = Archive(archive).run(document["run"])
    assert len(run.about["sources"]) == 4
    assert not run.table("procedure_points").empty


def test_a_file_without_unit_or_sample_interval_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    unit, reference = shock(1.0, rng)
    rows = "\n".join(f"{a:.9g},{b:.9g}" for a, b in zip(unit.samples, reference.samples, strict=True))
    bare, part = tmp_path / "bare.csv", tmp_path / "part.toml"
    part.write_text("scale = 0.3\n")
    for heads, units, rate, procedure, told in (
        ("dut,ref", {}, None, "shock", r"bare.csv: column 'dut' has no unit.*--unit-of output"),
        ("dut,ref", UNITS, None, "shock", r"no sample interval is stated.*--rate"),
        ("dut,ref", UNITS | {"reference": "psi"}, RATE, "shock", r"reference in 'psi'"),
        ("dut [V],ref [g]", {"output": "mV"}, RATE, "shock", r"states V, --unit-of has mV"),
        ("dut,ref", UNITS, RATE, "tilt", "can be imported"),
    ):
        bare.write_text(f"{heads}\n{rows}\n")
        layout = RecordingLayout(dict(zip(("z", "reference"), heads.split(","), strict=True)), units, rate)
        with pytest.raises((DataRejected, WrongUse), match=told):
            import_waveforms([bare], procedure, part, "S1", layout, str(tmp_path / "a"))
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
        made = ("dut", "V", "units", unit), ("ref", "m/s^2", "reference", reference)
        paths += write_waveforms("csv", [Channel(*one, 1.0 / RATE, 2) for one in made], tmp_path / f"dwell{k}.csv")
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
        layout = RecordingLayout(columns, UNITS, rate)
        document = import_waveforms(paths, "shock", part, "S1", layout, archive)
        kept = Archive(archive).run(document["run"]).table("procedure_figures").set_index("figure")["value"]
        shown = {one["figure"]: one["value"] for one in document["figures"] if one["identified"]}
        assert all(kept[name] == pytest.approx(value) for name, value in shown.items())
        values.append(document["run"])
    assert values[0] != values[1]
