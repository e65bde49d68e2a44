"""Weighted least squares of a model for all units of a lot at once.

Per unit and axis z = H·θ + v is solved as θ̂ = (HᵀWH)⁻¹HᵀWz, refined once where the system is ill-conditioned. Parameters
of the station, which all units share, are found after projecting the units' own columns out (Frisch–Waugh–Lovell), so
the cost stays linear in the units.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial import design
from inertial.design import Values
from inertial.effects import SensorEffect
from inertial.errors import NotIdentified
from inertial.fits.normal_equations import SINGULAR, LocalColumns
from inertial.state import State

Array = NDArray[np.float64]

_PIECE = 192
"""Units with designs of their own that are solved at a time: their columns stay in the processor's cache."""

_BATCHED = 3
"""Dimensions of an array with one series for each unit and axis."""


@dataclass(frozen=True)
class LotFit:
    """Coefficients of a model for every unit of a lot.

    effects : ids of the model, in order
    coefficients : (..., 3, p), output unit per unit of the column
    covariance : (..., 3, p, p), from the standard errors given, or from the residuals where none were
    names : per axis, (effect id, coefficient) of the p columns
    shared : (q,), parameters of the station; shared_covariance : (q, q); shared_names likewise
    nonlinear : values of nonlinear parameters and constants by effect id
    residuals : (..., n, 3), output unit, output minus model
    chi2 : (..., 3), sum of squared residuals over the variance; dof : (..., 3), degrees of freedom
    """

    effects: tuple[str, ...]
    coefficients: Array
    covariance: Array
    names: tuple[tuple[tuple[str, str], ...], ...]
    shared: Array
    shared_covariance: Array
    shared_names: tuple[tuple[str, str], ...]
    nonlinear: dict[str, dict[str, float]]
    residuals: Array
    chi2: Array
    dof: Array

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the coefficients, (..., 3, p)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))

    def response(self) -> Array:
        """The matrix K of each unit, (..., 3, 3), output per g: scale on the diagonal, misalignment beside it."""
        return response_matrix(self.coefficients, self.names)


def response_matrix(coefficients: Array, names: Sequence[Sequence[tuple[str, str]]]) -> Array:
    """K from coefficients (..., 3, p): the columns of ``scale`` and ``misalignment``, (..., 3, 3)."""
    k = np.zeros((*coefficients.shape[:-2], 3, 3))
    for axis in range(3):
        for column, (effect, _) in enumerate(names[axis]):
            if effect == "scale":
                k[..., axis, axis] = coefficients[..., axis, column]
        across = [c for c, (effect, _) in enumerate(names[axis]) if effect == "misalignment"]
        for column, other in zip(across, ((axis + 1) % 3, (axis + 2) % 3), strict=False):
            k[..., axis, other] = coefficients[..., axis, column]
    return k


def fit_lot(
    effects: Sequence[str],
    state: State,
    output: Array,
    standard_error: Array | None = None,
    *,
    nonlinear: Values | None = None,
) -> LotFit:
    """Least-squares fit of a model to the dwells of a lot.

    Parameters
    ----------
    effects : ids of the model
    state : the dwells; arrays may leave out the batch dimension where all units share them
    output : (..., n, 3), mean output of each dwell, in the output's unit
    standard_error : (..., n, 3), output unit; infinity takes a value out of the fit; None weighs all alike
    nonlinear : values of nonlinear parameters by effect id; the middle of their bounds otherwise
        (:func:`inertial.fits.profile.fit_profiled` finds them)

    Raises
    ------
    NotIdentified
        The plan cannot determine a coefficient; it is named.
    UnknownEffect, MissingInput
        An effect is not in the catalogue, or needs a quantity that the dwells do not carry.
    """
    sensor, station = design.split(effects)
    if state.felt is None and any(e.sharp for e in sensor):
        felt = felt_force(state.force, output, state.theta)
        first = fit_lot(effects, replace(state, felt=felt, memory={}), output, standard_error, nonlinear=nonlinear)
        better = own_axes(replace(state, felt=felt), first.response())
        return first if better is None else fit_lot(effects, better, output, standard_error, nonlinear=nonlinear)
    values = design.starting_values([*sensor, *station], state)
    for name, given in (nonlinear or {}).items():
        values[name] = {**values.get(name, {}), **given}
    z = np.swapaxes(output, -1, -2)
    names = tuple(design.local_names(sensor, axis, values) for axis in range(3))
    weight = None if standard_error is None else 1.0 / np.swapaxes(standard_error, -1, -2)
    shared, shared_covariance = np.zeros(0), np.zeros((0, 0))
    if not station:
        solved = _in_pieces(sensor, state, values, z, weight, names)
    else:
        local = LocalColumns(design.local_columns(sensor, state, values), weight, names)
        theta = local.solve(z)
        columns = design.shared_columns(station, state, values, response_matrix(theta, names))
        shared, shared_covariance, z = _solve_shared(local, columns, z, design.shared_names(station))
        solved = _solved(local, z)
    theta, residual, (chi2, dof), covariance = solved
    if weight is None:
        variance = chi2 / np.maximum(dof, 1)
        covariance = covariance * variance[..., None, None]
        shared_covariance = shared_covariance * float(chi2.sum() / max(dof.sum() - shared.size, 1))
    return LotFit(
        effects=tuple(dict.fromkeys(effects)),
        coefficients=theta,
        covariance=np.broadcast_to(covariance, (*theta.shape, theta.shape[-1])),
        names=names,
        shared=shared,
        shared_covariance=shared_covariance,
        shared_names=design.shared_names(station),
        nonlinear=values,
        residuals=np.swapaxes(residual, -1, -2),
        chi2=chi2,
        dof=dof,
    )


def _solved(local: LocalColumns, z: Array) -> "_Solution":
    theta = local.solve(z)
    residual = local.apply(theta)
    np.subtract(z, residual, out=residual)
    return _Solution(theta, residual, local.chi2(residual), local.inverse)


def _in_pieces(
    sensor: Sequence[SensorEffect],
    state: State,
    values: Values,
    z: Array,
    weight: Array | None,
    names: Sequence[Sequence[tuple[str, str]]],
) -> "_Solution":
    """The solution of a lot whose units have nothing in common but the model, some units at a time where each has its own design.

    What bounds it is memory: the columns of a thousand units pass through the cache once for each product, those of a piece stay.
    """
    own = state.temperature is not None and state.temperature.ndim > 1
    if z.ndim != _BATCHED or len(z) <= _PIECE or not (own or state.force.ndim == _BATCHED or _varies(weight, len(z))):
        return _solved(LocalColumns(design.local_columns(sensor, state, values), weight, names), z)
    units = len(z)
    kept: list[_Solution] = []
    for start in range(0, units, _PIECE):
        piece = slice(start, start + _PIECE)
        some = weight[piece] if _varies(weight, units) and weight is not None else weight
        kept.append(
            _solved(LocalColumns(design.local_columns(sensor, state.of(piece, units), values), some, names), z[piece])
        )
    theta, residual = (
        np.concatenate(parts) for parts in zip(*((one.theta, one.residual) for one in kept), strict=True)
    )
    chi2, dof = (np.concatenate(parts) for parts in zip(*(one.chi2 for one in kept), strict=True))
    shape = (units, *kept[0].covariance.shape[-3:])
    covariance = np.concatenate([np.broadcast_to(one.covariance, (len(one.theta), *shape[1:])) for one in kept])
    return _Solution(theta, residual, (chi2, dof), covariance)


def _varies(weight: Array | None, units: int) -> bool:
    return weight is not None and weight.ndim == _BATCHED and len(weight) == units


class _Solution(NamedTuple):
    """Coefficients (..., 3, p), residuals (..., 3, n), χ² and degrees of freedom (..., 3), covariance (..., 3, p, p)."""

    theta: Array
    residual: Array
    chi2: tuple[Array, Array]
    covariance: Array


_SAME_G = 1e-5
"""Change of the force along an axis, g, that adds less than 0.1 µg to the run of a scale factor of 200 ppm/K over 35 K."""

_WARM = 5.0
"""Range of temperature, K, from which on the bias' run with it would be taken for response where poses differ between soaks."""


def felt_force(force: Array, output: Array, theta: Array | None = None) -> Array:
    """Specific force along the sensor's own axes, (..., n, 3), g, from a plain fit of response and bias.

    Parameters
    ----------
    theta : (..., n), temperature above the reference, K: a bias that follows it is no response
    """
    x = np.concatenate([np.ones((*force.shape[:-1], 1)), force], axis=-1)
    if theta is not None and float(np.ptp(theta)) > _WARM:
        warm = np.stack([theta, theta**2], axis=-1) / float(np.max(np.abs(theta)))
        batch = np.broadcast_shapes(x.shape[:-1], warm.shape[:-1])
        x = np.concatenate([np.broadcast_to(c, (*batch, c.shape[-1])) for c in (x, warm)], axis=-1)
    coefficients = pseudo_inverses(x) @ output
    return force_along_axes(np.swapaxes(coefficients[..., 1:4, :], -1, -2), force)


def force_along_axes(response: Array, force: Array) -> Array:
    """Specific force along the sensor's own axes, (..., n, 3), g: rows of the response (..., 3, 3) over their diagonal."""
    return np.einsum("...ij,...nj->...ni", axis_rows(response), force)


def own_axes(state: State, response: Array) -> State | None:
    """The state with the force along the axes of a fitted response; None where it has that force already."""
    felt = force_along_axes(response, state.force)
    if state.felt is None:
        return replace(state, felt=felt, memory={})
    moved = np.max(np.abs(felt - state.felt), axis=(-2, -1), keepdims=True) > _SAME_G
    # unit by unit: the coefficients of a unit do not depend on the others of its lot
    return replace(state, felt=np.where(moved, felt, state.felt), memory={}) if np.any(moved) else None


def axis_rows(response: Array) -> Array:
    """Rows of a response (..., 3, 3) over their diagonal; a model without a scale factor has one of 1."""
    own = np.diagonal(response, axis1=-2, axis2=-1)
    rows = np.array(response / np.where(own == 0.0, 1.0, own)[..., :, None])
    rows[..., range(3), range(3)] = 1.0
    return rows


def pseudo_inverses(columns: Array) -> Array:
    """Pseudo-inverses (..., p, n) of columns (..., n, p); one serves all units where they have the same columns."""
    many = columns.reshape(-1, *columns.shape[-2:])
    if len(many) > 1 and np.array_equal(many, np.broadcast_to(many[0], many.shape)):
        one = np.asarray(np.linalg.pinv(many[0], rcond=1e-9), dtype=np.float64)
        return np.broadcast_to(one, (*columns.shape[:-2], *one.shape))
    return np.asarray(np.linalg.pinv(columns, rcond=1e-9), dtype=np.float64)


def _solve_shared(
    local: LocalColumns, columns: Array, z: Array, names: Sequence[tuple[str, str]]
) -> tuple[Array, Array, Array]:
    """Shared parameters, their covariance, and the targets without their part."""
    columns = np.broadcast_to(columns, (*z.shape, columns.shape[-1]))
    free = local.project_out(columns)
    target = local.project_out(z[..., None])[..., 0]
    q = free.shape[-1]
    flat = free.reshape(-1, q)
    size, before = np.linalg.norm(flat, axis=0), np.linalg.norm(columns.reshape(-1, q), axis=0)
    lost = np.flatnonzero(
        size <= 1e-7 * np.maximum(before * (1.0 if local.weight is None else float(np.max(local.weight))), 1e-300)
    )
    if lost.size:
        effect, name = names[int(lost[0])]
        raise NotIdentified(
            f"fit: {effect} ({name}) is one with what every unit fits for itself; leave it out of the model"
        )
    scaled = flat / size
    gram = scaled.T @ scaled
    if np.linalg.eigvalsh(gram)[0] < SINGULAR:
        raise NotIdentified(
            f"fit: the plan cannot tell these apart: {', '.join(f'{e} ({n})' for e, n in names)}; leave one out of the model"
        )
    inverse = np.linalg.inv(gram)
    shared = (inverse @ (scaled.T @ target.reshape(-1))) / size
    return shared, inverse / np.outer(size, size), z - np.matmul(columns, shared)
