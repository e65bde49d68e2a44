"""The one kernel of 1/f wander: its spectrum, its sums, and the two estimators that use it."""

import made_noise as generate
import numpy as np
import pandas as pd
import pytest
from long_suites import mostly_slow
from lots import dwell_rows
from scipy.integrate import quad

from inertial import poses
from inertial.frames import force_from_angles
from inertial.noise.flicker import constants_of_means, flicker_kernel, flicker_of_means, summed, time_constants
from pipelines.diagnosis.diagnose import diagnose
from pipelines.stages.fit import fit

MODEL = ["bias", "scale", "misalignment"]


def test_means_differ_as_an_integral_over_the_spectrum_says():
    """Mean squared difference of two means over T that are d apart: ∫ B²/(πf)·4·sin²(πfd)·sinc²(fT) df, slow parts cancel."""
    duration, slowest = 10.0, 1e5
    for apart in (20.0, 200.0, 2000.0):
        alike, away = flicker_of_means(np.array([0.0, apart]), duration, slowest)

        def density(log_f, d=apart):
            f = np.exp(log_f)
            return 4.0 / np.pi * np.sin(np.pi * f * d) ** 2 * np.sinc(f * duration) ** 2

        expected = quad(density, np.log(1e-7), np.log(1.0), limit=20000)[0]
        assert 2.0 * (alike - away) == pytest.approx(expected, rel=0.02)


def lot(seed: int, wander: float, white: float = 1e-5) -> pd.DataFrame:
    """Dwells of six units: 24 poses four times, Kasdin's flicker beside white noise of 10 µg."""
    rng = np.random.default_rng(seed)
    angles = np.tile(poses.plan("fibonacci24"), (4, 1))
    force = force_from_angles(*np.radians(angles).T)
    n, rows = len(force), []
    for unit in range(6):
        slow = generate.flicker(rng, (3, 20 * n), wander)[:, -n:].T if wander else 0.0
        gain = np.eye(3) + 0.01 * rng.normal(size=(3, 3))
        out = force @ gain.T + 0.01 * rng.normal(size=3) + slow + white * rng.normal(size=(n, 3))
        poses_ = [f"p{k % 24}" for k in range(n)]
        rows.append(dwell_rows(f"U{unit}", 20.0 * np.arange(n), force, out, 10.0 * white, pose=poses_, unit_C=25.0))
    return pd.concat(rows, ignore_index=True)


@pytest.mark.parametrize("seeds", mostly_slow([1, 2], 1))
@pytest.mark.parametrize("wander", mostly_slow([0.0, 2e-5], 2e-5))
def test_fit_and_diagnosis_find_the_same_noise(wander: float, seeds: int) -> None:
    """What each expects a right model to leave, µg: within a tenth of one another and of what is left indeed."""
    for seed in range(11, 11 + seeds):
        dwells = lot(seed, wander)
        residuals = fit(dwells, dwells.iloc[:0], MODEL)["residuals"]
        fitted, left = (float(np.sqrt(np.mean(residuals[name] ** 2))) for name in ("expected_ug", "residual_ug"))
        diagnosis = diagnose(dwells, None, MODEL)
        assert diagnosis["adequate"]
        assert diagnosis["error"]["floor_ug"] == pytest.approx(fitted, rel=0.1)
        assert left == pytest.approx(fitted, rel=0.1)
        assert (diagnosis["error"]["wander_share"] > 0.3) == (wander > 0.0)


@pytest.mark.parametrize("halves", [True, False])
def test_flicker_of_means_is_the_sum_of_its_processes_whatever_their_ratio(halves, rng):
    time = np.sort(rng.uniform(0.0, 3e4, 60))
    gap, duration = np.abs(time[:, None] - time), 120.0
    constants = constants_of_means(duration, 3e4) if halves else 3e4 * 3.0 ** -np.arange(9.0)
    expected = np.zeros(gap.shape)
    for tau in constants:
        inside = 1.0 - np.exp(-duration / tau)
        expected += (tau / duration * inside) ** 2 * np.exp(-np.maximum(gap - duration, 0.0) / tau)
    shares = constants / duration
    np.fill_diagonal(expected, np.sum(2.0 * shares * (1.0 - shares * (1.0 - np.exp(-1.0 / shares)))))
    near = (gap > 0.0) & (gap <= 0.5 * duration)  # dwells that would overlap are one
    made = summed(gap, constants, duration)
    np.testing.assert_allclose(made[~near], expected[~near], rtol=1e-11)


def test_processes_by_squares_are_those_by_exponentials() -> None:
    gap = np.abs(np.subtract.outer(np.arange(200) * 30.0, np.arange(200) * 30.0))
    constants = time_constants(24_000.0, 13)
    by_exponentials = sum(np.exp(-gap / tau) for tau in constants)
    np.testing.assert_allclose(summed(gap, constants), by_exponentials, rtol=1e-10)
    odd = np.array([300.0, 110.0, 7.0])
    np.testing.assert_allclose(summed(gap, odd), sum(np.exp(-gap / tau) for tau in odd), rtol=1e-14)
    kernel = flicker_kernel(np.arange(200) * 30.0)
    np.testing.assert_allclose(np.diagonal(kernel), 1.0)
    assert np.linalg.eigvalsh(kernel)[0] > 0.0
    time = np.array([0.0, 30.0, 60.0, 120.0])
    taus = time_constants(480.0, int(np.ceil(np.log2(480.0 / 10.0))))
    np.testing.assert_allclose(flicker_kernel(time), summed(np.abs(time[:, None] - time), taus) / taus.size)
