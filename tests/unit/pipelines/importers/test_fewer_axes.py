"""Devices with one axis or two, by textbook numbers: the ±1 g test by hand, and a tumble by its Fourier series."""

import json
from pathlib import Path

import lots
import numpy as np
import pandas as pd
import pytest
from in_process import document_of, given, refused, text_of

from pipelines.archive import Archive

SCALE, BIAS, ACROSS, K2 = 0.35, 2e-3, 1.5e-3, 50e-6  # V/g, V, rad, g/g²
OF_ONE = ("--set", "axes=x", "--unit-of", "output=V", "--set", "rows=dwells", "--units", "SF1")
TILT = "x=volts,tilt=angle_deg,sd_x=noise_V,n=samples"


def tilt_file(folder: Path) -> tuple[Path, pd.DataFrame]:
    """A tumble in steps of 15°, with quadratic and cross response, and noise of 1 µV."""
    angle = np.arange(0, 360, 15)
    sine, cosine = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    noise = np.random.default_rng(7).normal(0.0, 1e-6, angle.size)
    volts = BIAS + SCALE * (sine + ACROSS * cosine + K2 * sine**2) + noise
    table = pd.DataFrame({"angle_deg": angle, "volts": volts, "noise_V": 1e-5, "samples": 100})
    table.to_csv(folder / "SF1.csv", index=False)
    return folder / "SF1.csv", table


def imported(folder: Path, *words: object) -> str:
    return document_of("import", *words, *OF_ONE, "--archive", folder / "archive")["run"]


def coefficients(folder: Path, run: str) -> dict[str, tuple[float, float]]:
    table = Archive(folder / "archive").run(run).table("coefficients")
    return {r["name"]: (r["value"], r["standard_error"]) for r in table.to_dict("records") if r["axis"] == "x"}


def test_two_positions_give_half_the_sum_and_half_the_difference(tmp_path):
    up, down = np.array([0.3520012, 0.3519993, 0.3520004]), np.array([-0.3480007, -0.3479988, -0.3480011])
    rows = pd.DataFrame({"position": ["u", "d"] * 3, "volts": np.column_stack([up, down]).ravel()})
    rows.assign(noise_V=1e-5, samples=100).to_csv(tmp_path / "two.csv", index=False)
    mapped = ("--map", "x=volts,dwell=position,sd_x=noise_V,n=samples", "--set", "poses=u=+x,d=-x")
    mapped += ("--set", "local_gravity_m_s2=9.80665")
    fit = document_of("fit", imported(tmp_path, tmp_path / "two.csv", *mapped), "--archive", tmp_path / "archive")
    assert fit["effects"] == ["bias", "scale"]  # nothing across is shown: no misalignment is pretended
    assert fit["adequate"] is None
    found = coefficients(tmp_path, fit["run"])
    assert found["K1"][0] == pytest.approx((up.mean() - down.mean()) / 2.0, abs=1e-9)
    assert found["K0"][0] == pytest.approx((up.mean() + down.mean()) / 2.0, abs=1e-9)
    told = text_of("diagnose", fit["run"], "--archive", tmp_path / "archive")
    assert "cannot be determined from these poses: Kxy, Kxz" in told


@pytest.mark.slow
def test_a_tumble_is_its_fourier_series(tmp_path):
    path, table = tilt_file(tmp_path)
    run, archive = imported(tmp_path, path, "--map", TILT), tmp_path / "archive"
    plain = document_of("fit", run, "--archive", archive)
    assert plain["adequate"] is False
    assert plain["missing"] == [["second_order", "cross_axis_quadratic"]]  # sin² + cos² = 1: alike in one plane
    fit = document_of("fit", run, "--effects", "bias,scale,misalignment,second_order", "--archive", archive)
    assert fit["adequate"] is True
    found = coefficients(tmp_path, fit["run"])
    series = np.fft.rfft(table["volts"]) / len(table)  # sin² = (1 − cos 2θ)/2
    quadratic = -4.0 * series[2].real
    harmonic = {"K1": -2.0 * series[1].imag, "Kxy": 2.0 * series[1].real, "K2": quadratic}
    harmonic["K0"] = series[0].real - 0.5 * quadratic
    assert set(found) == set(harmonic)  # Kxz is held at zero, not fitted
    truth = {"K0": BIAS, "K1": SCALE, "Kxy": SCALE * ACROSS, "K2": SCALE * K2}
    for name, (value, error) in found.items():
        assert value == pytest.approx(harmonic[name], abs=0.5 * error), name
        assert abs(value - truth[name]) < 4.0 * error, name
    unit = json.loads(given("export", fit["run"], "--format", "json", "--archive", archive)[1])["units"][0]
    assert (unit["axes"], np.shape(unit["bias"]), np.shape(unit["response"])) == (["x"], (4, 1), (4, 1, 3))
    assert unit["response"][0][0] == pytest.approx([found["K1"][0], found["Kxy"][0], 0.0])
    assert "x alone" in refused("export", plain["run"], "--format", "px4", "--archive", archive)


def test_a_steady_turn_has_no_rest_at_its_turning_points(tmp_path):
    angle = 24.0 * np.arange(0.0, 45.0, 0.01)
    table = pd.DataFrame({"time_s": angle / 24.0, "angle_deg": angle, "volts": SCALE * np.sin(np.radians(angle))})
    table.to_csv(tmp_path / "turn.csv", index=False)
    words = ("--map", "time=time_s,x=volts,tilt=angle_deg", "--unit-of", "output=V", "--set", "axes=x", "--units", "S")
    told = refused("import", tmp_path / "turn.csv", *words, "--archive", tmp_path / "archive")
    assert "within dwell 0, one position is needed; a steady turn is read row by row with --set rows=dwells" in told


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        (("--map", TILT, "--set", "axes=w"), "'x', 'y' or 'z'"),
        (("--map", TILT), "or --set axes=x for a device with fewer axes"),
        (("--map", TILT, "--set", "axes=x,y"), "axes are x, y, and x mapped"),
        (("--map", TILT.replace("volts", "vots"), "--set", "axes=x"), "'vots'"),
        (("--map", TILT, "--set", "axes=x", "--fit", "norm"), "needs three axes"),
    ],
)
def test_a_slip_in_the_axes_is_refused_with_one_message(tmp_path, words, needed):
    path, _ = tilt_file(tmp_path)
    plain = ("--unit-of", "output=V", "--set", "rows=dwells", "--units", "SF1", "--archive", tmp_path / "archive")
    assert needed in refused("import", path, *words, *plain)


def test_a_table_with_two_outputs_is_a_device_with_two_axes(tmp_path):
    rng, force = np.random.default_rng(3), lots.force(lots.directions("fibonacci"))
    response = np.array([[1.01, 2e-3, -1e-3], [3e-3, 0.99, 1e-3]])
    output = force @ response.T + [0.01, -0.02] + rng.normal(0.0, 5e-6, (24, 2))
    table = pd.DataFrame({"unit": "T1", "dwell": range(24), "time_s": 30.0 * np.arange(24)})
    table[["force_x", "force_y", "force_z"]], table[["out_x", "out_y"]] = force, output
    table = table.assign(sd_x=5e-5, sd_y=5e-5, n=100, out_unit="g")
    table.to_csv(tmp_path / "two.csv", index=False)
    assert document_of("diagnose", tmp_path / "two.csv")["adequate"] is True
    bent = table.assign(out_y=table["out_y"] + 3e-4 * force[:, 1] ** 2)
    bent.to_csv(tmp_path / "bent.csv", index=False)
    told = document_of("diagnose", tmp_path / "bent.csv")
    assert (told["adequate"], told["where"][0]["axes"]) == (False, ["y"])
    assert "second_order" in told["classes"][0]["effects"]
    table.assign(sd_z=5e-5).to_csv(tmp_path / "slip.csv", index=False)
    assert "column out_z is missing" in refused("diagnose", tmp_path / "slip.csv")
