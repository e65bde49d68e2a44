"""The batched fit against plain least squares, its refusals, and the correction that undoes it."""

from dataclasses import replace

import lots
import numpy as np
import pytest

from inertial.correction import correct, predict, station_change
from inertial.errors import MissingInput, NotIdentified, UnknownEffect
from inertial.fits.linear import fit_lot
from inertial.state import State

LINEAR = ("bias", "scale", "misalignment")
THERMAL = (*LINEAR, "bias_temperature", "scale_temperature")


def state_and_output(rng, units=3, noise=1e-5, up=(0.0, 0.0, 1.0), temperatures=(0.0, 25.0, 50.0)):
    angles = np.tile(lots.directions("fibonacci"), (len(temperatures), 1))
    true, commanded = lots.force(angles, up), lots.force(angles)
    n = len(angles)
    k = np.eye(3) + rng.normal(0.0, 0.01, (units, 3, 3))
    bias = rng.normal(0.0, 0.05, (units, 1, 3))
    warm = np.repeat(temperatures, 24) + rng.normal(0.0, 0.2, (units, n))
    tempco = rng.normal(0.0, 1e-4, (units, 1, 3))
    output = np.einsum("uij,nj->uni", k, true) + bias + tempco * (warm - 25.0)[..., None]
    output = output + rng.normal(0.0, noise, output.shape)
    state = State(
        force=np.broadcast_to(commanded, output.shape),
        time=np.broadcast_to(30.0 * np.arange(n), (units, n)),
        temperature=warm,
        outer=np.broadcast_to(angles[:, 0], (units, n)),
        inner=np.broadcast_to(angles[:, 1], (units, n)),
    )
    return state, output, k, bias


def test_equals_lstsq_unit_by_unit_and_axis_by_axis(rng):
    state, output, *_ = state_and_output(rng)
    fit = fit_lot(LINEAR, state, output)
    for unit in range(3):
        for axis in range(3):
            j, l = (axis + 1) % 3, (axis + 2) % 3
            f = state.force[unit]
            h = np.stack([np.ones(len(f)), f[:, axis], f[:, j], f[:, l]], axis=1)
            expected = np.linalg.lstsq(h, output[unit, :, axis], rcond=None)[0]
            np.testing.assert_allclose(fit.coefficients[unit, axis], expected, rtol=1e-9, atol=1e-12)


def test_weights_equal_lstsq_of_weighted_rows(rng):
    state, output, *_ = state_and_output(rng)
    error = rng.uniform(1e-5, 5e-5, output.shape)
    along = state.force[..., 0] + 0.004 * state.force[..., 1] - 0.002 * state.force[..., 2]
    fit = fit_lot(THERMAL, replace(state, felt=np.repeat(along[..., None], 3, axis=-1)), output, error)
    f, theta = state.force[0], state.theta[0]
    h = np.stack([np.ones(len(f)), f[:, 0], f[:, 1], f[:, 2], theta, theta * along[0]], axis=1) / error[0, :, :1]
    expected, *_ = np.linalg.lstsq(h, output[0, :, 0] / error[0, :, 0], rcond=None)
    np.testing.assert_allclose(fit.coefficients[0, 0], expected, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(fit.covariance[0, 0], np.linalg.inv(h.T @ h), rtol=1e-6)


def test_shared_design_and_batched_design_give_the_same(rng):
    state, output, *_ = state_and_output(rng)
    shared = State(force=state.force[0], time=state.time[0])
    np.testing.assert_allclose(
        fit_lot(LINEAR, shared, output).coefficients,
        fit_lot(LINEAR, state, output).coefficients,
        rtol=1e-10,
        atol=1e-13,
    )


def test_an_infinite_error_takes_a_dwell_out(rng):
    state, output, *_ = state_and_output(rng)
    spoiled, error = output.copy(), np.full(output.shape, 1e-5)
    spoiled[0, 5] += 1.0
    error[0, 5] = np.inf
    fit = fit_lot(THERMAL, state, spoiled, error)
    assert fit.dof[0, 0] == fit.dof[1, 0] - 1
    np.testing.assert_allclose(fit.response()[0], fit_lot(THERMAL, state, output).response()[0], atol=2e-5)


def test_level_of_the_table_is_found_from_the_whole_lot(rng):
    state, output, *_ = state_and_output(rng, units=6, noise=1e-5, up=(1e-4, -2e-4, 1.0))
    fit = fit_lot((*THERMAL, "level_error"), state, output)
    pulls = (fit.shared - [1e-4, -2e-4]) / np.sqrt(np.diag(fit.shared_covariance))
    assert np.all(np.abs(pulls) < 4.0)
    change = station_change(fit.effects, state, fit.shared, fit.nonlinear)
    np.testing.assert_allclose(
        change[0], lots.force(np.tile(lots.directions("fibonacci"), (3, 1)), (1e-4, -2e-4, 0.0)), atol=1e-5
    )


def test_correction_undoes_the_model_with_its_nonlinearity(rng):
    state, output, *_ = state_and_output(rng, noise=0.0)
    curved = output + 1e-3 * state.force**3 + 5e-4 * state.force[..., [1, 2, 0]] * state.force
    model = (*THERMAL, "third_order", "cross_coupling")
    fit = fit_lot(model, state, curved)
    corrected = correct(fit.effects, state, curved, fit.coefficients, fit.nonlinear)
    modelled = predict(fit.effects, state, fit.coefficients, fit.nonlinear)
    assert np.abs(corrected - state.force).max() < 1.5 * np.abs(curved - modelled).max() + 1e-9


def test_refuses_poses_that_never_turn_an_axis_over_and_names_the_coefficients():
    angles = np.zeros((6, 2))
    state = State(force=lots.force(angles), time=np.arange(6.0))
    with pytest.raises(NotIdentified, match=r"scale|misalignment"):
        fit_lot(LINEAR, state, np.zeros((1, 6, 3)))


def test_refuses_effects_that_the_plan_makes_one(rng):
    state, output, *_ = state_and_output(rng)
    with pytest.raises(NotIdentified, match="slot_rotation"):
        fit_lot((*LINEAR, "slot_rotation"), state, output)


def test_names_the_quantity_that_is_not_recorded(rng):
    state, output, *_ = state_and_output(rng)
    with pytest.raises(MissingInput, match="supply"):
        fit_lot((*LINEAR, "supply_sensitivity"), state, output)


def test_names_close_matches_of_an_unknown_effect(rng):
    state, output, *_ = state_and_output(rng)
    with pytest.raises(UnknownEffect, match="third_order"):
        fit_lot((*LINEAR, "third_oder"), state, output)
