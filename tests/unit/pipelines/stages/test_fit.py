"""The fit stage: noise between dwells, nonlinear parameters, and what it says where it cannot find the noise."""

import made_noise as generate
import numpy as np
import pandas as pd
import pytest
from lots import dwell_rows

from inertial import poses
from inertial.frames import force_from_angles
from pipelines.stages.fit import fit
from pipelines.stages.verify import verify
from pipelines.tables.calibration import read_calibration
from schemas.errors import DataRejected
from schemas.table_check import check

LINEAR = ["bias", "scale", "misalignment", "bias_temperature"]
LAG = [*LINEAR, "thermal_lag"]
TAU, LAGGING, WHITE = 240.0, 8e-5, 2e-5
NO_HISTORY = pd.DataFrame({name: pd.Series(dtype=float) for name in ("time_s", "chamber_C", "slot", "unit", "unit_C")})


def chamber(time: np.ndarray) -> np.ndarray:
    """Four levels in turn, approached within minutes."""
    out = np.full(time.shape, 25.0)
    for start, level in ((0.0, 40.0), (900.0, 10.0), (1800.0, 55.0), (2700.0, 25.0)):
        out = np.where(time >= start, level + (out - level) * np.exp(-np.maximum(time - start, 0.0) / 60.0), out)
    return out


def late(time: np.ndarray, temperature: np.ndarray, tau: float) -> np.ndarray:
    """Temperature of a body that follows through a thermal resistance, step by step."""
    out = temperature.copy()
    for k in range(1, time.size):
        out[k] = out[k - 1] + (temperature[k - 1] - out[k - 1]) * (time[k] - time[k - 1]) / tau
    return out


def lot(
    rng: np.random.Generator, units: int = 6, wander: float = 0.0, lagging: float = LAGGING
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Dwells and history of a lot in a chamber that never rests."""
    angles = np.tile(np.concatenate([poses.plan("fibonacci24"), [[35.0, 15.0], [105.0, -100.0]]]), (4, 1))
    force = force_from_angles(*np.radians(angles).T)
    n = len(angles)
    time, fine = 20.0 + 34.0 * np.arange(n), np.arange(0.0, 3600.0, 1.0)
    heat = chamber(fine)
    behind = np.interp(time, fine, late(fine, heat, TAU) - heat)
    own = np.interp(time, fine, heat)
    dwells, history = [], []
    for u in range(units):
        slow = generate.flicker(rng, (3, 20 * n), wander)[:, -n:].T if wander else 0.0
        gain = np.eye(3) + 0.01 * rng.normal(size=(3, 3))
        out = force @ gain.T + 0.02 * rng.normal(size=3) + (own - 25.0)[:, None] * 1e-4 * rng.normal(size=3)
        out = out + lagging * behind[:, None] + slow + WHITE * rng.normal(size=(n, 3))
        kinds = np.where(np.arange(n) % 26 < 24, "dwell", "verification")
        poses_ = [f"p{k % 26}" for k in range(n)]
        dwells.append(dwell_rows(f"U{u}", time, force, out, 10.0 * WHITE, pose=poses_, kind=kinds, unit_C=own))
        history.append(
            pd.DataFrame(
                {"time_s": fine[::10], "chamber_C": heat[::10], "slot": u, "unit": f"U{u}", "unit_C": heat[::10]}
            )
        )
    return pd.concat(dwells, ignore_index=True), pd.concat(history, ignore_index=True)


def test_a_lag_is_found_with_its_error_and_verified_by_what_came_before_each_dwell(rng: np.random.Generator) -> None:
    dwells, history = lot(rng)
    fitted = fit(dwells, history, LAG)
    rows = fitted["coefficients"]
    tau = rows[rows["name"] == "tau"].iloc[0]
    assert tau["value"] == pytest.approx(TAU, rel=0.03)
    assert 0.0 < tau["standard_error"] < 0.05 * TAU
    assert abs(tau["value"] - TAU) < 5.0 * tau["standard_error"] + 2.0
    np.testing.assert_allclose(rows[rows["name"] == "kL"]["value"], LAGGING, rtol=0.1)
    tables = [fitted[name] for name in ("coefficients", "covariance", "predictions")]
    verified, means = (verify(dwells, history, *tables)[name] for name in ("verification", "verification_poses"))
    assert set(means["dwells"]) == {4}  # one in each soak, of one error
    changed = dwells.copy()
    hot = np.where((dwells["unit"] == "U0") & (dwells["pose"] == "p24"), np.sign(dwells["unit_C"] - 30.0), 0.0)
    for axis in "xyz":
        changed[f"out_{axis}"] += 20.0 * WHITE * hot * dwells[f"force_{axis}"]
    means = verify(changed, history, *tables)["verification_poses"].set_index(["unit", "pose"])
    assert means.query("dwells < 4").index.tolist() == [("U0", "p24")]  # its errors at the soaks are no mean of zero
    assert abs(means.loc[("U0", "p24"), "error_ug"]) > 15e6 * WHITE
    assert 0.8 < np.std(verified["error_ug"] / verified["uncertainty_ug"]) < 1.25
    assert verified["error_ug"].abs().max() < 5.0 * 1e6 * WHITE
    # a time constant for each axis is read as it was written
    own = [
        rows[rows["name"] == "tau"].assign(axis=axis, value=value)
        for axis, value in zip("xyz", (1.0, 2.0, 3.0), strict=True)
    ]
    written = pd.concat([rows[rows["name"] != "tau"], *own]).sort_values(["unit"], kind="stable")
    assert read_calibration(written, fitted["covariance"]).nonlinear["thermal_lag"]["tau"] == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(("unit", "per_g"), [("g", 1.0), ("m/s^2", 9.80665)])
def test_a_model_without_scale_has_residuals_by_the_unit_of_its_output(rng, unit, per_g):
    """One orientation: a bias and its tempco, in which the force is a part of the bias."""
    dwells, _ = lot(rng, units=2, lagging=0.0)
    tempco = np.array([1e-4, -2e-4, 3e-4])
    for i, a in enumerate("xyz"):
        dwells[f"force_{a}"] = float(a == "z")
        noise = WHITE * rng.normal(size=len(dwells))
        dwells[f"out_{a}"] = per_g * (float(a == "z") + tempco[i] * (dwells["unit_C"] - 25.0) + noise)
        dwells[f"sd_{a}"] *= per_g
    fitted = fit(dwells.assign(out_unit=unit), NO_HISTORY, ["bias", "bias_temperature"])
    for name, table in fitted.items():
        check(name, table)
    residuals = fitted["residuals"]["residual_ug"]
    assert 0.8 * WHITE < 1e-6 * float(np.std(residuals)) < 1.2 * WHITE
    assert np.isfinite(fitted["wander"]["white_ug"]).all()


def test_a_model_without_scale_of_counts_is_refused_and_too_few_dwells_for_the_noise_are_told(
    rng: np.random.Generator,
) -> None:
    dwells, _ = lot(rng, units=2)
    with pytest.raises(DataRejected, match=r"no 'scale', and the outputs are in LSB.* add 'scale'"):
        fit(dwells.assign(out_unit="LSB"), NO_HISTORY, ["bias", "bias_temperature"])
    dwells, _ = lot(rng, units=1)
    few = dwells[dwells["dwell"] < 5]
    fitted = fit(few, NO_HISTORY, ["bias", "scale", "misalignment"])
    assert set(fitted["wander"]["method"]) == {"birge"}
    assert np.isfinite(fitted["coefficients"]["standard_error"]).all()


@pytest.mark.parametrize("levels", [0, 3], ids=["any value", "three levels"])
def test_a_recorded_covariate_is_fitted_and_verified(rng: np.random.Generator, levels: int) -> None:
    dwells, history = lot(rng, units=3, lagging=0.0)
    humidity = 45.0 + 8.0 * np.sin(dwells["time_s"].to_numpy() / 700.0)
    dwells["humidity_pct"] = np.round(humidity / 8.0) * 8.0 if levels else humidity
    assert not levels or dwells["humidity_pct"].nunique() == levels
    for axis in "xyz":
        dwells[f"out_{axis}"] += 4e-5 * (dwells["humidity_pct"] - 45.0)
    plain, humid = (fit(dwells, history, model) for model in (LINEAR, [*LINEAR, "covariate:humidity_pct"]))
    left = [float(np.sqrt(np.mean(tables["residuals"]["residual_ug"] ** 2))) for tables in (plain, humid)]
    assert left[0] > 100.0
    assert left[1] < 1.3e6 * WHITE
    calibration = read_calibration(humid["coefficients"], humid["covariance"])
    line = calibration.value("covariate:humidity_pct")[..., 0]
    if levels:
        half = float(np.ptp(dwells.loc[dwells["kind"] == "dwell", "humidity_pct"])) / 2.0
        np.testing.assert_allclose(line, 4e-5 * half, atol=2e-5)
    errors = verify(dwells, history, humid["coefficients"], humid["covariance"], humid["predictions"])["verification"]
    assert float(np.sqrt(np.mean(errors["error_ug"] ** 2))) < 60.0
