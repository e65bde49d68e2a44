"""Correction of an output with a calibration: a = K⁻¹(ã − b), with temperature and every other effect of the model."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inertial import design
from inertial.arrays import Array
from inertial.design import Values, of_axes
from inertial.effects import SensorEffect
from inertial.fits.linear import force_along_axes, of_every_axis, response_matrix
from inertial.state import ALL_AXES, State

_STEPS = 12
"""Fixed-point steps: each shrinks the error by the size of the nonlinearity, below 0.1 for any sensor worth calibrating."""


def predict(effects: Sequence[str], state: State, coefficients: Array, nonlinear: Values) -> Array:
    """Output of the model (..., n, 3), in the output's unit, for coefficients (..., 3, p); station effects left out."""
    sensor = design.split(effects)[0]
    names = tuple(design.local_names(sensor, axis, nonlinear) for axis in state.axes)
    response = response_matrix(coefficients, names, state.axes)
    felt = force_along_axes(response, state.force)
    return _output(sensor, replace(state, felt=felt, memory={}), coefficients, nonlinear)


def _output(sensor: Sequence[SensorEffect], state: State, coefficients: Array, nonlinear: Values) -> Array:
    columns = design.local_columns(sensor, state, nonlinear)
    return np.swapaxes(np.matmul(columns, coefficients[..., None])[..., 0], -1, -2)


def station_change(effects: Sequence[str], state: State, shared: Array, nonlinear: Values) -> Array:
    """True minus commanded specific force, (..., n, 3), g, from the station's parameters (q,)."""
    _, station = design.split(effects)
    if not station:
        return np.zeros(state.force.shape)
    changes = np.concatenate([e.force_change(state, **design.on_axis(nonlinear, e.id)) for e in station], axis=-1)
    return changes @ shared


def correct(effects: Sequence[str], state: State, output: Array, coefficients: Array, nonlinear: Values) -> Array:
    """Specific force (..., n, 3) in g that explains an output.

    Parameters
    ----------
    effects : ids of the model
    state : conditions of the readings; its force is only the starting point where the model has memory
    output : (..., n, 3), in the output's unit
    coefficients : (..., 3, p), as fitted
    nonlinear : values of nonlinear parameters and constants by effect id
    """
    # across the axes of a device with one or two the force is not measured: it is that of the state, zero where none is known
    sensed = np.isin(np.arange(3), state.axes)
    force = np.where(sensed, 0.0, np.broadcast_to(state.force, (*output.shape[:-1], 3)))
    at = _Inverse(effects, coefficients, nonlinear, state.axes)
    for _ in range(_STEPS):
        step = at.step(state, output, force)
        force = force + step
        if float(np.max(np.abs(step), initial=0.0)) < 1e-12:
            break
    return force


def remaining_step(
    effects: Sequence[str], state: State, output: Array, coefficients: Array, nonlinear: Values, force: Array
) -> Array:
    """Change (..., n, 3) in g that a further step of :func:`correct` would make: rounding errors where it has converged.

    Parameters
    ----------
    force : (..., n, 3) in g, as :func:`correct` returns it; the others as there
    """
    return _Inverse(effects, coefficients, nonlinear, state.axes).step(state, output, force)


class _Inverse:
    """The inverse of a model's response, which every step uses; its parameters are those of :func:`correct`."""

    def __init__(
        self, effects: Sequence[str], coefficients: Array, nonlinear: Values, axes: tuple[int, ...] = ALL_AXES
    ) -> None:
        self._sensor = design.split(effects)[0]
        names = tuple(design.local_names(self._sensor, axis, nonlinear) for axis in axes)
        self._axes = axes
        self._coefficients, self._nonlinear = coefficients, nonlinear
        self._response = response_matrix(coefficients, names, axes)
        self._inverse = np.linalg.inv(of_axes(of_axes(self._response, axes, -1), axes, -2))

    def step(self, state: State, output: Array, force: Array) -> Array:
        """Change (..., n, 3) in g of a force (..., n, 3) in g towards the one that explains an output (..., n, 3)."""
        felt = replace(state, force=force, felt=force_along_axes(self._response, force), memory={})
        left = output - _output(self._sensor, felt, self._coefficients, self._nonlinear)
        change = np.einsum("...ij,...nj->...ni", self._inverse, left)
        return np.swapaxes(of_every_axis(np.swapaxes(change, -1, -2), self._axes), -1, -2)


def output_covariance(
    effects: Sequence[str], state: State, coefficients: Array, nonlinear: Values, covariance: Array
) -> Array:
    """Covariance (n, 3, 3) in g² of corrected outputs of one unit, from that of its coefficients: K⁻¹·(h_iᵀ·Σ_ij·h_j)·K⁻ᵀ.

    Parameters
    ----------
    state : conditions of the readings, its force the corrected one
    coefficients : (3, p)
    covariance : (3p, 3p), of the coefficients of x, y and z in one vector
    """
    names = tuple(design.local_names(design.split(effects)[0], axis, nonlinear) for axis in state.axes)
    response = response_matrix(coefficients, names, state.axes)
    seen = replace(state, felt=force_along_axes(response, state.force), memory={})
    columns = design.local_columns(design.split(effects)[0], seen, nonlinear)
    p = columns.shape[-1]
    m = len(state.axes)
    blocks = covariance.reshape(m, p, m, p)
    inner = np.einsum("inp,ipjq,jnq->nij", columns, blocks, columns, optimize=True)
    inverse = np.linalg.inv(of_axes(of_axes(response, state.axes, -1), state.axes, -2))
    return inverse @ inner @ inverse.T
