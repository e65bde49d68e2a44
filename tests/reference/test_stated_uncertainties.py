"""Stated uncertainties against brute force: noise drawn from its spectra, the truth known, the share within k = 2 counted."""

import numpy as np
import pytest
from long_suites import mostly_slow

from inertial import poses
from inertial.fits.wander import fit_lot_with_wander, student
from inertial.frames import force_from_angles
from inertial.noise.dwells import DwellNoise, dwell_covariance
from inertial.planning.expected import expected_errors
from inertial.planning.visibility import visibilities
from inertial.state import State

LINEAR = ("bias", "scale", "misalignment")
DWELL_S, POWERED_S = 10.0, 60.0
# one-sided white density µg/√Hz, bias instability µg, random walk µg/√s, as data sheets state them
KINDS = {"white": (280.0, 0.0, 0.0), "flicker": (7.0, 150.0, 0.0), "all": (25.0, 300.0, 4.0)}


def plan(name, repeats=1, step=25.0):
    angles = np.radians(np.tile(poses.plan(name), (repeats, 1)))
    time = POWERED_S + step * np.arange(len(angles))
    return State(force=force_from_angles(angles[:, 0], angles[:, 1]), time=time)


def covariance(time, density, instability, walk):
    """Covariance (n, n) of dwell means, g², by quadrature of the one-sided spectra; slower flicker is the bias itself."""
    gap = np.abs(time[:, None] - time)
    f = np.geomspace(1.0 / (4.0 * time.max()), 20.0 / DWELL_S, 3000)
    power = instability**2 / (np.pi * f) * np.sinc(f * DWELL_S) ** 2
    lags = np.unique(gap)
    by_lag = np.trapezoid(power * np.cos(2.0 * np.pi * f * lags[:, None]) * f, np.log(f), axis=-1)
    flicker = np.interp(gap, lags, by_lag)
    slow = walk**2 * (np.minimum(time[:, None], time) - np.eye(len(time)) * DWELL_S / 6.0)
    return 1e-12 * (density**2 / (2.0 * DWELL_S) * np.eye(len(time)) + flicker + slow)


def pulls(rng, state, kind, units, lots):
    """Errors over stated errors, (lots·units, 3, p), and the errors themselves."""
    root = np.linalg.cholesky(covariance(state.time, *KINDS[kind]))
    white = 1e-6 * KINDS[kind][0] / np.sqrt(2.0 * DWELL_S)
    ratios, errors = [], []
    for _ in range(lots):
        noise = root @ rng.standard_normal((units, 3, len(root), 1))
        out = state.force + np.swapaxes(noise[..., 0], -1, -2)
        fit = fit_lot_with_wander(LINEAR, state, out, np.full(out.shape, white)).fit
        errors.append(fit.coefficients - [0.0, 1.0, 0.0, 0.0])
        ratios.append(errors[-1] / fit.standard_errors)
    return np.concatenate(ratios), np.concatenate(errors)


def within(values):
    return np.mean(np.abs(values) < 2.0)


@pytest.mark.parametrize("units", mostly_slow([1, 4], 4))
@pytest.mark.parametrize("kind", mostly_slow(KINDS, "white", "all"))
def test_six_faces_are_as_good_as_they_say(rng, kind, units):
    ratios, _ = pulls(rng, plan("six"), kind, units, {1: 48, 4: 24}[units])
    assert within(ratios[..., 0]) > 0.84  # the walk before the first dwell is the bias's, and not seen
    assert 0.93 < within(ratios[..., 1:]) < 0.995


MANY = [("white", 40, 0.2), ("all", 20, 0.3), ("all", 40, 0.2), ("flicker", 40, 0.2)]


@pytest.mark.parametrize(("kind", "runs", "apart"), mostly_slow(MANY, *MANY[:2]))
def test_coefficients_of_many_dwells_are_as_good_as_they_say(rng, kind, runs, apart):
    state, noise = plan("twelve", repeats=3), DwellNoise(*(1e-6 * x for x in KINDS[kind]))
    ratios, errors = pulls(rng, state, kind, 4, runs)
    assert within(ratios[..., 0]) > 0.92
    assert within(ratios[..., 1:]) == pytest.approx(0.9545, abs=0.02)
    expected = expected_errors(LINEAR, state, dwell_covariance(state.time, DWELL_S, noise)).errors
    assert np.sqrt(np.mean(errors**2, axis=0))[:, 1:] / expected[:, 1:] == pytest.approx(1.0, abs=apart)


def test_student_s_factor_is_that_of_the_guide():
    """JCGM 100, table G.2, 95.45 %: 13.97, 4.53, 2.87, 2.28 and 2.13 for 1, 2, 4, 10 and 20 degrees of freedom."""
    assert [round(2.0 * student(dof), 2) for dof in (1, 2, 4, 10, 20)] == [13.97, 4.53, 2.87, 2.28, 2.13]


@pytest.mark.parametrize("kind", ["white", "all"])
def test_of_effects_as_large_as_their_floor_half_stand_out_by_three_sigma(rng, kind):
    state = plan("fibonacci24")
    noise = covariance(state.time, *KINDS[kind])
    own = DwellNoise(*(1e-6 * x for x in KINDS[kind]))
    of_plan = dwell_covariance(state.time, DWELL_S, own)
    seen = visibilities(state, LINEAR, 1.0, ["second_order", "third_order"], covariance=of_plan)
    white = np.linalg.inv(np.linalg.cholesky(noise))
    for sight, power in zip(seen, (2, 3), strict=True):
        beyond = []
        for axis in range(3):
            x = white @ np.column_stack([np.ones(len(noise)), state.force, state.force[:, axis] ** power])
            sigma = np.sqrt(np.linalg.inv(x.T @ x)[-1, -1])
            y = sight.floor * x[:, [-1]] + rng.standard_normal((len(x), 4000))
            estimate = np.abs(np.linalg.lstsq(x, y, rcond=None)[0][-1]) / sigma
            beyond.append((np.mean(estimate > 3.0), np.mean(estimate > 2.0)))
        assert max(beyond) == (pytest.approx(0.5, abs=0.04), pytest.approx(0.84, abs=0.03))
