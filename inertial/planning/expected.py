"""Expected standard error of every coefficient, from the plan and the noise model, before the measurement."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial import design
from inertial.arrays import Array
from inertial.effects import SensorEffect
from inertial.errors import NotIdentified
from inertial.noise.dwells import whitener
from inertial.population.family import with_prior
from inertial.state import State

_SINGULAR = 1e-11  # smallest eigenvalue of a scaled normal matrix that determines all coefficients, as in a fit


@dataclass(frozen=True)
class Expected:
    """Expected standard errors of a fit.

    names : per axis, (effect id, coefficient) of the p columns; errors : (3, p), g per unit of the column
    shared_names : (effect id, parameter) of the q parameters of the station; shared_errors : (q,), g per unit of the column
    """

    names: tuple[tuple[tuple[str, str], ...], ...]
    errors: Array
    shared_names: tuple[tuple[str, str], ...]
    shared_errors: Array


def expected_errors(
    effects: Sequence[str], state: State, covariance: Array, *, units: int = 1, prior: Array | None = None
) -> Expected:
    """Standard errors of a generalised least-squares fit of a model to planned dwells.

    (Hᵀ·C⁻¹·H)⁻¹ per axis; parameters of the station, which all units share, after projection onto the complement of
    the units' own columns. Nonlinear parameters are set to the middle of their bounds.

    Parameters
    ----------
    effects : ids of the model
    state : the planned dwells of one unit, (n,)
    covariance : (n, n), of the dwell means of one axis, g²
    units : number of units that share the station's parameters
    prior : (3, p, p), precision of a prior of the coefficients, 1/g²

    Raises
    ------
    NotIdentified
        The plan cannot determine a coefficient.
    """
    sensor, station = design.split(effects)
    values = design.starting_values([*sensor, *station], state)
    white = whitener(covariance)
    h, inverse = _whitened(sensor, state, values, white)
    shared = np.zeros(0)
    if station:
        s = white @ design.shared_columns(station, state, values, np.eye(3))
        left = s - h @ (inverse @ (np.swapaxes(h, -1, -2) @ s))
        flat = left.reshape(-1, left.shape[-1])
        square = inverted(flat, design.shared_names(station)) / units
        shared = np.sqrt(np.diagonal(square))
        across = inverse @ (np.swapaxes(h, -1, -2) @ s)
        inverse = inverse + across @ square @ np.swapaxes(across, -1, -2)
    inverse = inverse if prior is None else with_prior(inverse, prior)
    return Expected(
        names=tuple(design.local_names(sensor, axis, values) for axis in state.axes),
        errors=np.sqrt(np.diagonal(inverse, axis1=-2, axis2=-1)),
        shared_names=design.shared_names(station),
        shared_errors=shared,
    )


def expected_gain(effects: Sequence[str], state: State, covariance: Array) -> Array:
    """Derivative of the coefficients of a plan's fit by every dwell, (3, p, n): (Hᵀ·C⁻¹·H)⁻¹·Hᵀ·C⁻¹ of the sensor's effects.

    Parameters
    ----------
    effects, state, covariance : as in :func:`expected_errors`
    """
    sensor, _ = design.split(effects)
    white = whitener(covariance)
    h, inverse = _whitened(sensor, state, design.starting_values(sensor, state), white)
    return inverse @ (np.swapaxes(h, -1, -2) @ white)


def _whitened(sensor: Sequence[SensorEffect], state: State, values: design.Values, white: Array) -> tuple[Array, Array]:
    """Whitened columns (3, n, p) of the sensor's effects, and the inverses (3, p, p) of their products."""
    h = white @ design.local_columns(sensor, state, values)
    return h, np.stack(
        [inverted(part, design.local_names(sensor, axis, values)) for axis, part in zip(state.axes, h, strict=True)]
    )


def inverted(columns: Array, names: Sequence[tuple[str, str]]) -> Array:
    """(XᵀX)⁻¹ of whitened columns (n, p), inverted with scaled columns; raises NotIdentified where it is singular."""
    size = np.linalg.norm(columns, axis=0)
    if np.any(size <= 0.0):
        effect, name = names[int(np.argmin(size))]
        raise NotIdentified(f"plan: {effect} ({name}) is zero in every dwell; add poses or conditions that excite it")
    scaled = columns / size
    gram = scaled.T @ scaled
    if float(np.linalg.eigvalsh(gram)[0]) < _SINGULAR:
        share = np.abs(np.linalg.eigh(gram)[1][:, 0])
        listed = ", ".join(f"{names[i][0]} ({names[i][1]})" for i in np.argsort(-share) if share[i] > 0.1)
        raise NotIdentified(
            f"plan: these coefficients are confounded: {listed}; add poses or temperatures that separate them"
        )
    return np.asarray(np.linalg.inv(gram), dtype=np.float64) / np.outer(size, size)
