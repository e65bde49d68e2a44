"""Stages on small lots of known physics."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from capture_double import STANDARD_G, CaptureDouble, plan, small_job
from long_suites import mostly_slow

from pipelines.archive import Run
from pipelines.stages.fit import fit
from pipelines.stages.reduce import reduce
from pipelines.stages.validate import validate
from pipelines.tables.calibration import read_calibration
from pipelines.tables.dwells import lot_arrays
from pipelines.tables.summaries import summarised
from schemas.errors import DataRejected

NO_HISTORY = pd.DataFrame({"time_s": [], "chamber_C": [], "slot": [], "unit": [], "unit_C": []})


def test_reduce_gives_means_spreads_numbers_and_the_reference_and_verification_and_noise_are_those_of_the_double(
    run: Run,
) -> None:
    samples, dwells = run.table("samples"), run.table("dwells")
    row = dwells.iloc[4]
    own = samples[(samples["unit"] == row["unit"]) & (samples["record"] == row["record"])]
    assert row["n"] == len(own)
    assert np.isclose(row["out_y"], own["y"].mean())
    assert np.isclose(row["sd_z"], own["z"].std())
    norm = np.linalg.norm(dwells[["force_x", "force_y", "force_z"]], axis=1)
    np.testing.assert_allclose(norm, 9.8123 / STANDARD_G, rtol=1e-12)
    assert set(dwells["kind"]) == {"dwell", "verification"}  # without the static record
    verification = run.table("verification")
    assert (verification["error_ug"].abs() < 5.0 * verification["uncertainty_ug"]).all()
    assert (verification["reading_ug"] < verification["uncertainty_ug"]).all()
    noise = run.table("noise").set_index(["unit", "axis", "term"])
    expected = 1e-4 / np.sqrt(100.0) * 1e6
    assert np.isclose(noise.loc[("A1", "x", "N"), "value"], expected, rtol=0.1)
    assert np.isclose(noise.loc[("A1", "x", "n_d"), "value"], np.sqrt(2.0) * expected, rtol=0.1)
    assert not noise.loc[("A1", "x", "B"), "identified"]


def test_fit_finds_what_the_devices_are(run: Run, tmp_path: Path) -> None:
    job, double = small_job(tmp_path), CaptureDouble(noise_g=0.0)
    calibration = read_calibration(run.table("coefficients"), run.table("covariance"))
    still = np.random.default_rng(1)
    for slot in range(3):
        zero = double.output(slot, np.zeros(3), 25.0, (1, 3), still)[0]
        errors = calibration.standard_error("bias")[slot, :, 0]
        assert np.all(np.abs(calibration.value("bias")[slot, :, 0] - zero) < 4.5 * errors + 1.0)
    assert job.recipe.effects == list(calibration.effects)
    units = run.table("coefficients").drop_duplicates("effect").set_index("effect")["unit_text"]
    assert units.to_dict() == {
        "bias": "LSB", "scale": "LSB/g", "misalignment": "LSB/g", "bias_temperature": "LSB/K", "scale_temperature": "LSB/(g·K)",
    }  # fmt: skip


def test_lack_of_fit_widens_the_uncertainty(run: Run) -> None:
    dwells = run.table("dwells")
    bent = dwells.assign(out_x=dwells["out_x"] + 3000.0 * dwells["force_x"] ** 2)
    effects = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
    straight, wider = (
        fit(table, NO_HISTORY, effects)["coefficients"].set_index(["unit", "axis", "effect"])
        for table in (dwells, bent)
    )
    ratio = (wider["standard_error"] / straight["standard_error"]).loc[("A1", "x", "bias")]
    assert ratio > 3.0


def test_units_with_different_dwells_or_units_of_output_are_not_fitted_together(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    dwells = run.table("dwells")
    monkeypatch.setattr("pipelines.stages.fit.MOST", 7)
    with pytest.raises(
        DataRejected, match=r"fit: \d+ dwells of a unit, at most 7 can be fitted together; average neighbours"
    ):
        fit(dwells, NO_HISTORY, ["bias", "scale"])
    with pytest.raises(DataRejected, match="every unit needs every dwell"):
        lot_arrays(dwells.iloc[1:])
    dwells.loc[dwells["unit"] == "A2", "out_unit"] = "V"
    with pytest.raises(DataRejected, match="outputs in LSB and V"):
        lot_arrays(dwells)


def captured(folder: Path, fault: str) -> tuple[list[pd.DataFrame], pd.DataFrame, pd.DataFrame]:
    """Samples, readings and verdicts of a lot in which unit A2 has a fault."""
    job, double = small_job(folder), CaptureDouble({"A2": fault})
    records = [double.record(job, *step) for step in plan(job.recipe)]
    samples, readings = [r[0] for r in records], pd.concat([r[1] for r in records], ignore_index=True)
    return samples, readings, validate(summarised(samples, readings), readings, job.lot.units)


UNIT_FAULTS = [
    ("stuck", "stuck_output", "constant output 77 LSB on y in record 0"),
    ("dead", "dead_channel", "dead channel z: the specific force explains"),
    ("nan", "not_finite", "nan on x in row 17"),
    ("infinity", "not_finite", "inf on x in row 17"),
    ("clipped", "clipped", "1 samples at full scale"),
    ("overflow", "overflow", "buffer overflow in record 2"),
    ("short", "dropped_samples", "50 samples of 100 in record 2"),
    ("stale", "stale_temperature", "moved 0.00 K while the chamber moved 50.0 K"),
    ("silent", "stopped_answering", "stopped answering at record 3"),
]


@pytest.mark.parametrize(
    ("fault", "name", "words"),
    mostly_slow(UNIT_FAULTS, *UNIT_FAULTS[1::3]),
)
def test_refuses_the_unit_with_a_fault_and_no_other(tmp_path: Path, fault: str, name: str, words: str) -> None:
    samples, readings, verdicts = captured(tmp_path, fault)
    table = verdicts.set_index("unit")
    assert table["refused"].to_dict() == {"A1": False, "A2": True, "A3": False}
    assert table.loc["A2", "fault"] == name
    assert words in table.loc["A2", "reason"]
    assert set(reduce(summarised(samples, readings), readings, verdicts, 9.81)["unit"]) == {"A1", "A3"}


def test_a_unit_that_never_answered_has_a_verdict(tmp_path: Path) -> None:
    samples, readings, _ = captured(tmp_path, "")
    without = readings[readings["unit"] != "A3"]
    verdicts = validate(summarised(samples, without), without, small_job(tmp_path).lot.units).set_index("unit")
    assert verdicts.loc["A3", "refused"]
    assert "no reading for 23 of 23 records" in verdicts.loc["A3", "reason"]


def test_a_recorded_covariate_stays_in_the_dwells_unless_it_has_a_gap(tmp_path: Path) -> None:
    samples, readings, verdicts = captured(tmp_path, "")
    readings["humidity_pct"] = 45.0 + 0.1 * readings["record"]
    dwells = reduce(summarised(samples, readings), readings, verdicts, 9.81)
    np.testing.assert_allclose(dwells["humidity_pct"], 45.0 + 0.1 * dwells["record"])
    readings.loc[readings["record"] == 3, "humidity_pct"] = np.nan
    assert "humidity_pct" not in reduce(summarised(samples, readings), readings, verdicts, 9.81)
