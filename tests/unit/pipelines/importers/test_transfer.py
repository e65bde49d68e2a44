"""A transfer function that was measured elsewhere is judged, kept and refused with the reason."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from each import each
from in_process import document_of
from scipy import signal

from pipelines.importers.content import Content
from pipelines.importers.files import read_content
from pipelines.importers.transfer import import_transfer
from pipelines.importers.transfer_columns import PointsLayout, output_of, transfer_points
from schemas.errors import DataRejected, WrongUse

HEAD = "frequency_hz,magnitude,phase_deg,magnitude_uncertainty_percent,phase_uncertainty_deg"


def written(path: Path, *, low_pass_hz: float = 1e9, u: tuple[float, float] = (0.2, 0.15)) -> Path:
    """A CSV of a 2500 Hz sensor by scipy's own frequency response, 0.2 % and 0.15° a point, of which ``u`` is stated."""
    rng, f = np.random.default_rng(1), np.geomspace(5.0, 5000.0, 30)
    wn, low = 2.0 * np.pi * np.array([2500.0, low_pass_hz])
    h = signal.freqs([wn**2 * low], np.polymul([1.0, 1.4 * wn, wn**2], [1.0, low]), 2.0 * np.pi * f)[1]
    size, phase = 1.0 + 0.002 * rng.normal(size=f.size), 0.15 * rng.normal(size=f.size)
    rows = np.column_stack([f, 0.3 * np.abs(h) * size, np.degrees(np.angle(h)) + phase, *np.tile(u, (f.size, 1)).T])
    np.savetxt(path, rows, "%.9g", ",", header=HEAD, comments="")
    return path


def test_the_missing_pole_is_named_and_the_error_falls_and_where_points_scatter_far_no_parameter_is_stated(
    tmp_path: Path,
) -> None:
    words = ("--procedure", "sweep", "--units", "S1", "--archive", tmp_path / "archive")
    diagnosis = document_of("import", written(tmp_path / "b.csv", low_pass_hz=6000.0), *words, status=1)
    assert diagnosis["adequate"] is False
    assert "one_pole" in diagnosis["classes"][0]["effects"]
    assert diagnosis["extended_percent"] < 0.2 * diagnosis["error_percent"]
    assert diagnosis["left_out"][1] == pytest.approx(1.0, abs=0.25)
    assert diagnosis["recommended"]
    diagnosis = document_of("import", written(tmp_path / "a.csv", u=(2e-4, 1.5e-4)), *words, status=1)
    assert not any(parameter["identified"] for parameter in diagnosis["parameters"].values())
    (told,) = (line for line in diagnosis["text"] if "delay" in line and not line.startswith("model:"))
    assert told.startswith("not determined: bandwidth, natural frequency, damping ratio, delay: the model, also with")
    assert any(line.startswith("polarity: positive") for line in diagnosis["text"])


def test_phases_that_follow_nothing_tell_no_polarity(tmp_path: Path) -> None:
    path, rng = written(tmp_path / "a.csv"), np.random.default_rng(4)
    table = pd.read_csv(path)
    table["phase_deg"] = rng.uniform(-180.0, 180.0, len(table))
    table.to_csv(path, index=False)
    words = ("import", path, "--procedure", "sweep", "--units", "S1", "--archive", tmp_path / "archive")
    assert "polarity" not in " ".join(document_of(*words, status=1)["text"])


@each([
    ("f,h", "1,2", r"no column is recognised as frequency, magnitude, phase .* --map frequency=…,magnitude=…,phase=…"),
    ("frequency_hz,magnitude,phase", "1,2,0", r"column 'phase' has no unit, one of deg, rad is needed; add --unit-of phase=…"),
    ("frequency_hz,magnitude,phase_rad", "1,2,0", "no magnitude uncertainty .*--map magnitude_uncert.*repeatability_percent"),
    (HEAD, "1,-3,0,1,1", "a magnitude in dB needs --unit-of magnitude=dB"),
    (HEAD, "1,2,0,0,1", "a value above 0"),
    (HEAD, "1,2,x,1,1", "a finite number"),
    (HEAD, "1,2,0,1,1", "1 points"),
])  # fmt: skip
def test_a_file_without_units_or_values_is_refused(row: tuple[str, str, str], tmp_path: Path) -> None:
    head, line, needed = row
    path = tmp_path / "bad.csv"
    path.write_text(f"{head}\n{line}\n")
    with pytest.raises(DataRejected, match=needed):
        import_transfer(path, "S1", archive=str(tmp_path / "archive"))


@each(["Sensitivity [mV/(m/s^2)]", "Empfindlichkeit [mV/ms-2]"])
def test_a_sensitivity_per_m_s2_is_one_per_g_after_the_import(head: str, tmp_path: Path) -> None:
    path = written(tmp_path / "b.csv")
    path.write_text(path.read_text("utf-8").replace("magnitude", head, 1), encoding="utf-8")
    done = import_transfer(path, "S1", archive=str(tmp_path / "archive"))
    assert done["sensitivity"] == pytest.approx(0.3 * 9.80665, rel=2e-3)
    assert any(" mV per g, " in line for line in done["text"])
    with pytest.raises(WrongUse, match=r"--unit-of magnitude=mV has none; leave it out"):
        import_transfer(path, "S1", archive=str(tmp_path / "archive"), layout=PointsLayout(units={"magnitude": "mV"}))


@each([("banana", None), ("V/mg", None), ("mV/V/g", ""), ("mV/V/(m/s^2)", ""), ("LSB", "LSB"), ("V/g", "V")])
def test_a_unit_of_no_sensitivity_is_refused_and_one_per_supply_is_no_voltage(
    row: tuple[str, str | None], tmp_path: Path
) -> None:
    content = Content(pd.read_csv(written(tmp_path / "b.csv")))
    layout = PointsLayout(units={"magnitude": row[0]})
    if row[1] is None:
        with pytest.raises(WrongUse, match=f"magnitude={row[0]}: unknown; write V/g"):
            transfer_points(content, "b.csv", layout)
    else:
        transfer_points(content, "b.csv", layout)
        assert output_of(content, layout) == row[1]


@each([" (k=2)", ", k = 2.00"])
def test_an_expanded_uncertainty_is_divided_by_the_factor_that_its_heading_states(ending: str, tmp_path: Path) -> None:
    standard = pd.read_csv(written(tmp_path / "b.csv"))
    u, v = HEAD.split(",")[3:]
    expanded = standard.assign(**{u: 2.0 * standard[u], v: 2.0 * standard[v]})
    expanded["phase_deg"], expanded["Temp"] = -standard["phase_deg"], 23.0
    names = {u: f"U mag [%]{ending}", v: f"U phase [deg]{ending}", "phase_deg": "Phase lag [deg]"}
    expanded = expanded.rename(columns=names)
    expanded.to_csv(tmp_path / "k.csv", index=False)
    contents = Content(standard), read_content(tmp_path / "k.csv")[0]
    of, told = zip(*(transfer_points(content, "b.csv", PointsLayout()) for content in contents), strict=True)
    assert np.allclose(of[1].value, of[0].value)  # a lag is turned over
    assert "'Phase lag [deg]' in deg, a lag, " in told[1]
    assert "not read: 'Temp'" in told[1]
    assert np.allclose(of[1].magnitude_error, of[0].magnitude_error)
    assert np.allclose(of[1].phase_error, of[0].phase_error)
