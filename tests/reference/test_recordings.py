"""Real recordings by others against what was published about them (sources: README of the folder of recordings)."""

import json
from pathlib import Path

import numpy as np
import pytest

from inertial.fits.ellipsoid import fit_ellipsoid
from inertial.fits.faces import faces, ferraris
from inertial.fits.polynomial import fit_temperature_curve
from inertial.static_intervals import find
from pipelines.diagnosis.imported_norms import norm
from pipelines.importers import files
from pipelines.importers.mapping import build
from pipelines.importers.record import imported

MILLI = 1e3
FACES = np.concatenate([np.eye(3), -np.eye(3)]) * 9.81


class TestHandHeldTumble:
    """Xsens MTi in the hand, imu_tk test data; gravity 9.81744 m/s² by its test program."""

    gravity = 9.81744

    @pytest.fixture
    def means(self, shared_data: Path) -> np.ndarray:
        table, _ = files.read(shared_data / "xsens-tumble" / "xsens_acc.mat.gz")
        record = table.to_numpy()
        rate = (len(record) - 1) / (record[-1, 0] - record[0, 0])
        still = find(record[:, 1:], rate)
        return np.stack([record[a:b, 1:].mean(axis=0) for a, b in zip(still.start, still.stop, strict=True)])

    def test_nine_parameters_leave_no_more_than_one_millimetre_per_second_squared(self, means: np.ndarray) -> None:
        assert 36 <= len(means) <= 41  # the static positions are found by themselves
        fit = fit_ellipsoid(means, norm=self.gravity)
        assert float(fit.rms) * MILLI <= 1.0
        scale = np.diagonal(fit.response)
        np.testing.assert_allclose(scale, [415.0, 413.0, 415.0], rtol=0.005)

    def test_the_fit_with_wander_and_its_verdict_agree_with_the_published_coefficients(self, shared_data: Path) -> None:
        columns = {"columns": {"time": "1", "x": "2", "y": "3", "z": "4"}, "units": {"output": "LSB"}}
        mapping = build({**columns, "unit": "MTi", "local_gravity_m_s2": self.gravity}, "test")
        table, _ = files.read(shared_data / "xsens-tumble" / "xsens_acc.mat.gz")
        answer = norm(imported(table, mapping, "xsens_acc"), mapping)
        assert answer.adequate is True
        np.testing.assert_allclose(answer.document["scale_per_m_s2"], [414.4, 412.0, 414.6], atol=0.1)
        assert answer.document["error"]["rms_ug"] * self.gravity * 1e-3 == pytest.approx(1.0, abs=0.15)  # mm/s²
        assert answer.document["error"]["six_parameters_rms_ug"] * self.gravity * 1e-3 == pytest.approx(34.0, abs=1.0)

    def test_six_parameters_and_the_nominal_values_leave_what_was_found_by_others(self, means: np.ndarray) -> None:
        six = fit_ellipsoid(means, norm=self.gravity, shape="six")
        assert float(six.rms) * MILLI == pytest.approx(33.7, abs=0.3)
        nominal = np.linalg.norm((means - 32768.0) / 415.0, axis=1) - self.gravity
        assert np.sqrt(np.mean(nominal**2)) * MILLI == pytest.approx(1011.0, rel=0.01)


class TestFerraris:
    """Six faces by hand with the published answer of the imucal project, g = 9.81."""

    @pytest.fixture
    def session(self, shared_data: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        table, _ = files.read(shared_data / "ferraris" / "annotated_session.csv")
        parts = table.groupby("part")[["acc_x", "acc_y", "acc_z"]]
        error = (parts.std() / np.sqrt(parts.count())).loc[["x_p", "y_p", "z_p", "x_a", "y_a", "z_a"]].mean()
        means = parts.mean()
        up, down = means.loc[["x_p", "y_p", "z_p"]], means.loc[["x_a", "y_a", "z_a"]]
        return up.to_numpy(), down.to_numpy(), error.to_numpy()

    def test_the_published_calibration_comes_back(self, session: tuple, shared_data: Path) -> None:
        expected = json.loads((shared_data / "ferraris" / "expected_calibration.json").read_text())
        calibration = ferraris(session[0], session[1], 9.81)
        np.testing.assert_allclose(calibration.scale, expected["K_a"], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(calibration.rotation, expected["R_a"], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(calibration.bias, expected["b_a"], rtol=1e-9)

    def test_all_eighteen_means_fit_better_and_show_the_lack_of_fit(self, session: tuple) -> None:
        up, down, error = session
        means = np.concatenate([up, down])
        better = faces(up, down, 9.81, error)
        published = ferraris(up, down, 9.81)
        left = FACES @ published.response.T + published.bias - means
        assert np.all(np.sum(better.residuals**2, axis=0) < 0.9 * np.sum(left**2, axis=0))
        assert np.all(better.rms > 10.0 * better.pure_error)
        assert np.all(better.p_value < 1e-50)


class TestWornUnit:
    """84 hours on a wrist, GGIR's published offset, scale and temperature offset."""

    @pytest.fixture
    def windows(self, shared_data: Path) -> tuple[np.ndarray, np.ndarray]:
        table, _ = files.read(shared_data / "worn-unit" / "static_windows.csv.gz")
        return table[["meanx", "meany", "meanz"]].to_numpy(), table["temperature"].to_numpy()

    @pytest.mark.parametrize("shape", ["six", "nine"])
    def test_our_fit_is_no_worse(self, windows: tuple, shape: str) -> None:
        fit = fit_ellipsoid(windows[0], temperature=windows[1], shape=shape)
        assert np.abs(fit.norm_residuals).mean() <= 0.0023


def test_a_chamber_cycle_is_not_described_by_a_cubic_in_temperature(shared_data: Path) -> None:
    """One pose over 52 → -17.6 → 74 → 36 °C: the output follows the rate of the temperature too."""
    table, _ = files.read(shared_data / "chamber-cycle" / "imu_raw_data.csv")
    output = table[["imu.acc.x", "imu.acc.y", "imu.acc.z"]].to_numpy()
    fit = fit_temperature_curve(output, table["imu.temperature"].to_numpy())
    np.testing.assert_allclose(fit.rms * MILLI, [6.4, 17.3, 44.2], rtol=0.01)
    np.testing.assert_allclose(fit.noise * MILLI, [3.2, 3.2, 5.2], rtol=0.03)
    assert not fit.adequate
    ninth = fit_temperature_curve(output, table["imu.temperature"].to_numpy(), degree=9)
    np.testing.assert_allclose(ninth.rms * MILLI, [6.3, 17.2, 43.6], rtol=0.01)
