"""A lot whose outputs wander between dwells: the errors of the coefficients are what they say."""

import made_noise as generate
import numpy as np
import pytest
from posed import posed

from inertial import poses
from inertial.errors import NotIdentified
from inertial.fits.linear import fit_lot
from inertial.fits.wander import fit_lot_with_wander, lack_of_fit
from inertial.frames import force_from_angles
from inertial.noise.dwells import DwellNoise, dwell_covariance
from inertial.state import State

EFFECTS = ("bias", "scale", "misalignment")


def of_bias(fit) -> tuple[np.ndarray, np.ndarray]:
    """Biases (units, 3) and their standard errors."""
    place = [names.index(("bias", "K0")) for names in fit.names]
    return fit.coefficients[:, range(3), place], fit.standard_errors[:, range(3), place]


@pytest.mark.slow
def test_a_pattern_of_the_table_hides_no_flicker_of_quiet_units() -> None:
    """Flicker of 30 µg under an error of the poses of 100 µg that every soak repeats: the bias scatters as is stated."""
    rng = np.random.default_rng(5)
    angles = np.radians(rng.uniform(-180.0, 180.0, (24, 2)))
    force = np.tile(force_from_angles(angles[:, 0], angles[:, 1]), (3, 1))
    time = 17.0 * np.arange(len(force))
    root = np.linalg.cholesky(dwell_covariance(time, 10.0, DwellNoise(0.1e-6, 30e-6), since=-5.0))
    pulls, alone = [], []
    for _ in range(14):
        table = np.tile(100e-6 * rng.standard_normal((24, 3)), (3, 1))
        wander = np.einsum("nm,uma->una", root, rng.standard_normal((6, len(force), 3)))
        for common, into in ((table, pulls), (0.0, alone)):
            state, error = State(force=force, time=time), np.full((6, len(force), 3), 1e-6)
            bias, stated = of_bias(fit_lot_with_wander(EFFECTS, state, force + wander + common, error).fit)
            into.extend(((bias - bias.mean(axis=0)) / (stated * np.sqrt(5.0 / 6.0))).ravel().tolist())
    assert np.mean(np.abs(alone) < 1.96) == pytest.approx(0.95, abs=0.04)
    assert np.mean(np.abs(pulls) < 1.96) > 0.9


UNITS, DWELLS, WHITE = 60, 48, 1e-5
ERROR = np.full((UNITS, DWELLS, 3), WHITE)


@pytest.fixture
def plan() -> State:
    return posed(np.tile(poses.plan("fibonacci24"), (2, 1)), 30.0)


def outputs(rng: np.random.Generator, plan: State, flicker: float, walk: float) -> np.ndarray:
    shape = (UNITS, 3, 40 * DWELLS)  # long before the first dwell: the wander has no beginning
    wander = generate.flicker(rng, shape, flicker)[..., -DWELLS:]
    wander = wander + generate.random_walk(rng, (UNITS, 3, DWELLS), walk, 1.0)
    noise = WHITE * rng.normal(size=(UNITS, DWELLS, 3))
    return plan.force + np.swapaxes(wander, -1, -2) + noise


def test_without_wander_it_is_the_weighted_fit(plan: State, rng: np.random.Generator) -> None:
    out = outputs(rng, plan, 0.0, 0.0)
    wander_fit, plain = fit_lot_with_wander(EFFECTS, plan, out, ERROR), fit_lot(EFFECTS, plan, out, ERROR)
    assert (wander_fit.flicker, wander_fit.walk) == (0.0, 0.0)
    assert wander_fit.white == pytest.approx(1.0, abs=0.03)
    np.testing.assert_allclose(wander_fit.fit.coefficients, plain.coefficients, atol=1e-12)


def test_parameters_of_the_station_are_found_within_their_errors(plan: State, rng: np.random.Generator) -> None:
    tilt, model = 1e-3, (*EFFECTS, "level_error")
    lean = force_from_angles(plan.outer, plan.inner, up=(tilt, 0.0, np.sqrt(1.0 - tilt**2)))
    out = outputs(rng, plan, 1e-4, 0.0) + (lean - plan.force)
    fit, plain = fit_lot_with_wander(model, plan, out, ERROR).fit, fit_lot(model, plan, out, ERROR)
    ours, theirs = np.sqrt(np.diag(fit.shared_covariance)), np.sqrt(np.diag(plain.shared_covariance))
    assert np.all(np.abs(np.abs(fit.shared[np.argmax(np.abs(fit.shared))]) - tilt) < 5.0 * ours.max())
    assert np.all(ours > 1.5 * theirs)


def test_under_a_strong_walk_the_bias_is_that_of_the_mean_of_the_record(plan: State, rng: np.random.Generator) -> None:
    steps = 2e-4 * rng.normal(size=(UNITS, 100 * DWELLS, 3))
    walk = np.cumsum(steps, axis=1) / 10.0  # a hundred steps from one dwell to the next
    out = plan.force + walk[:, ::100] + WHITE * rng.normal(size=(UNITS, DWELLS, 3))
    bias, stated = of_bias(fit_lot_with_wander(EFFECTS, plan, out, ERROR).fit)
    of_record, of_first = bias - walk[:, : 100 * (DWELLS - 1)].mean(axis=1), bias - walk[:, 0]
    # the error that is stated has the mean of the flicker in it that the fit cannot tell from this walk
    assert 0.6 < np.sqrt(np.mean((of_record / stated) ** 2)) < 1.1
    assert np.std(of_record) < 0.3 * np.std(of_first)


def test_dwells_left_out_are_predicted_within_their_errors(plan: State, rng: np.random.Generator) -> None:
    out, used = outputs(rng, plan, 1e-4, 0.0), np.arange(DWELLS) % 4 != 3
    wander_fit = fit_lot_with_wander(EFFECTS, plan, out, ERROR, used=used)
    spread = np.sqrt(np.diagonal(wander_fit.predicted, axis1=-2, axis2=-1))
    assert 0.9 < np.std(np.swapaxes(wander_fit.fit.residuals, -1, -2)[..., ~used] / spread) < 1.1
    assert 0.9 < np.std((wander_fit.fit.residuals / wander_fit.expected)[:, used]) < 1.1
    mean = np.swapaxes(wander_fit.fit.residuals, -1, -2)[..., ~used].mean(axis=-1)
    assert 0.85 < np.std(mean / np.sqrt(wander_fit.predicted.mean(axis=(-1, -2)))) < 1.15
    alone = fit_lot_with_wander(EFFECTS, plan, np.where(used[:, None], out, 7.0), ERROR, used=used).fit
    np.testing.assert_allclose(alone.coefficients, wander_fit.fit.coefficients, rtol=1e-9, atol=1e-12)


def test_a_unit_that_the_model_does_not_fit_leaves_the_others_alone(plan: State, rng: np.random.Generator) -> None:
    out = outputs(rng, plan, 1e-4, 0.0)
    before = fit_lot_with_wander(EFFECTS, plan, out, ERROR)
    out[3, :, 0] += 0.02 * plan.force[:, 0] ** 3
    after = fit_lot_with_wander(EFFECTS, plan, out, ERROR)
    ratio = after.fit.standard_errors / before.fit.standard_errors
    assert np.all(ratio[3, 0] > 3.0)
    np.testing.assert_allclose(np.delete(ratio.reshape(-1, 4), 9, axis=0), 1.0, rtol=0.1)
    assert after.lack_of_fit[3, 0] > 10.0


def test_refuses_a_plan_without_a_dwell_to_spare_and_a_reading_without_error(
    plan: State, rng: np.random.Generator
) -> None:
    out, error = outputs(rng, plan, 0.0, 0.0), ERROR.copy()
    with pytest.raises(NotIdentified, match="leave nothing to judge the noise by"):
        fit_lot_with_wander(EFFECTS, plan, out, ERROR, used=np.arange(DWELLS) < 4)
    error[3, 7, 1] = 0.0
    with pytest.raises(NotIdentified, match="standard error is zero"):
        fit_lot_with_wander(EFFECTS, plan, out, error)
    assert np.isnan(lack_of_fit(np.array([np.nan, 5.0]), 5)[0])  # a misfit that is no number is no good fit
