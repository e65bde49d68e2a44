"""The batched fit against plain least squares, in pieces too, and its refusals."""

import lots
import numpy as np
import pytest
from each import each

from inertial import poses
from inertial.correction import station_change
from inertial.errors import MissingInput, NotIdentified, UnknownEffect
from inertial.fits.linear import felt_force, fit_lot
from inertial.frames import force_from_angles
from inertial.state import State

LINEAR = ("bias", "scale", "misalignment")
THERMAL = (*LINEAR, "bias_temperature", "scale_temperature")


def state_and_output(rng, units=3, noise=1e-5, up=(0.0, 0.0, 1.0), temperatures=(0.0, 25.0, 50.0)):
    angles = np.tile(lots.directions("fibonacci"), (len(temperatures), 1))
    true, commanded = lots.force(angles, up), lots.force(angles)
    n = len(angles)
    k = np.eye(3) + rng.normal(0.0, 0.01, (units, 3, 3))
    warm = np.repeat(temperatures, 24) + rng.normal(0.0, 0.2, (units, n))
    tempco = rng.normal(0.0, 1e-4, (units, 1, 3))
    output = np.einsum("uij,nj->uni", k, true) + rng.normal(0.0, 0.05, (units, 1, 3))
    output = output + tempco * (warm - 25.0)[..., None] + rng.normal(0.0, noise, (units, n, 3))
    time, outer, inner = (np.broadcast_to(one, (units, n)) for one in (30.0 * np.arange(n), *angles.T))
    state = State(force=np.broadcast_to(commanded, output.shape), time=time, temperature=warm, outer=outer, inner=inner)
    return state, output


def test_an_infinite_error_takes_a_dwell_out(rng):
    state, output = state_and_output(rng)
    spoiled, error = output.copy(), np.full(output.shape, 1e-5)
    spoiled[0, 5] += 1.0
    error[0, 5] = np.inf
    fit = fit_lot(THERMAL, state, spoiled, error)
    assert fit.dof[0, 0] == fit.dof[1, 0] - 1
    np.testing.assert_allclose(fit.response()[0], fit_lot(THERMAL, state, output).response()[0], atol=2e-5)


def test_level_of_the_table_is_found_from_the_whole_lot(rng):
    state, output = state_and_output(rng, units=6, noise=1e-5, up=(1e-4, -2e-4, 1.0))
    fit = fit_lot((*THERMAL, "level_error"), state, output)
    pulls = (fit.shared - [1e-4, -2e-4]) / np.sqrt(np.diag(fit.shared_covariance))
    assert np.all(np.abs(pulls) < 4.0)
    change = station_change(fit.effects, state, fit.shared, fit.nonlinear)[0]
    leaning = lots.force(np.column_stack([state.outer[0], state.inner[0]]), (1e-4, -2e-4, 0.0))
    np.testing.assert_allclose(change, leaning, atol=1e-5)


REFUSED = [
    ("slot_rotation", NotIdentified, "slot_rotation"),  # the plan makes it one with misalignment
    ("supply_sensitivity", MissingInput, "no supply_V;"),
    ("third_oder", UnknownEffect, "third_order"),
    ("my_glue", UnknownEffect, "--effect-file"),  # of the model of a run, say
]


@each(REFUSED)
def test_refusals_name_what_is_confused_missing_or_meant(row, rng):
    effect, error, named = row
    with pytest.raises(error, match=named):
        fit_lot((*LINEAR, effect), *state_and_output(rng))
    still = State(force=lots.force(np.zeros((6, 2))), time=np.arange(6.0))  # poses that turn no axis over
    with pytest.raises(NotIdentified, match=r"scale|misalignment"):
        fit_lot(LINEAR, still, np.zeros((1, 6, 3)))


WARM = ("bias", "scale", "misalignment", "bias_temperature", "bias_temperature_quadratic", "scale_temperature")
MANY = 40


def large_lot(rng: np.random.Generator) -> tuple[State, np.ndarray, np.ndarray]:
    """One plan, each unit with its own temperatures and weights."""
    angles = np.radians(poses.plan("fibonacci24"))
    force = np.tile(force_from_angles(angles[:, 0], angles[:, 1]), (3, 1))
    heat = np.repeat([-20.0, 25.0, 60.0], 24) + rng.normal(scale=0.5, size=(MANY, 72))
    k = np.eye(3) + 3e-3 * rng.normal(size=(MANY, 3, 3))
    out = np.einsum("uij,nj->uni", k, force) + 5e-5 * heat[..., None] + 1e-5 * rng.normal(size=(MANY, 72, 3))
    return State(force=force, time=np.arange(72.0), temperature=heat), out, rng.uniform(1e-5, 3e-5, out.shape)


@pytest.mark.parametrize("weights", ["alike", "by dwell"])
def test_units_of_a_large_lot_are_the_units_alone(rng: np.random.Generator, weights: str) -> None:
    state, out, error = large_lot(rng)
    weighted = weights == "by dwell"
    fit = fit_lot(WARM, state, out, error if weighted else None)
    for unit in (0, 17, MANY - 1):
        heat = np.asarray(state.temperature)[unit]
        own = State(force=state.force, time=state.time, temperature=heat)
        alone = fit_lot(WARM, own, out[unit], error[unit] if weighted else None)
        for name in ("coefficients", "covariance", "residuals", "chi2", "dof"):
            one, other = getattr(fit, name)[unit], getattr(alone, name)
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())
        theta, f = heat - 25.0, state.force
        along = felt_force(f, out[unit], theta)
        for axis in range(3):
            j, k = (axis + 1) % 3, (axis + 2) % 3
            columns = [np.ones(72), f[:, axis], f[:, j], f[:, k], theta, theta**2, theta * along[:, axis]]
            weight = 1.0 / error[unit, :, axis] if weighted else np.ones(72)
            plain = np.linalg.lstsq(np.array(columns).T * weight[:, None], out[unit, :, axis] * weight, rcond=None)[0]
            np.testing.assert_allclose(fit.coefficients[unit, axis], plain, rtol=1e-8, atol=1e-12)
            if weighted:
                h = np.array(columns).T * weight[:, None]
                np.testing.assert_allclose(fit.covariance[unit, axis], np.linalg.inv(h.T @ h), rtol=1e-6)


def test_a_plan_that_confuses_coefficients_is_refused_with_their_names_in_any_piece(rng: np.random.Generator) -> None:
    state, out, _ = large_lot(rng)
    heat = np.array(state.temperature)
    heat[MANY - 1] = 30.0
    with pytest.raises(NotIdentified, match="bias"):
        fit_lot(WARM, State(force=state.force, time=state.time, temperature=heat), out)
