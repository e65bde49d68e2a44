"""Influences of a station on dwells: what each does to force, temperature and output, and the sensitivity of the outputs to it.

Angles, directions and equations: δ1, δ2 tilt the base, up = (δ1, δ2, 1); η turns about y between the outer and the inner axis;
encoder errors add to the angles; the seat turns the fixture's slot; the thermometer reads true + e + κ·θ.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inertial.arrays import Array, Places
from inertial.correction import predict
from inertial.design import Values, of_axes
from inertial.frames import rotation_x, rotation_z
from inertial.state import T_REFERENCE, State

STEP = 1e-6
"""Of the central differences: rad, or relative."""
STEP_K = 1e-3
SAME_AT_EVERY_VISIT = ("station", "run")
"""Scopes of a scattered error that repeats of a pose do not average."""
APART_DEG = 0.25
"""Between angles of different poses; readings of one pose differ by less than the tolerance of a station's position."""


@dataclass(frozen=True)
class Errors:
    """Errors of a station at n dwells; zero where nothing is stated.

    gravity : relative; level : (2,), δ1 and δ2, rad; orthogonality : rad
    outer, inner : (n,) or a number, true angle minus reading, rad
    temperature : (n,) or a number, reading minus true, K
    seat : (3,), rotation vector of the slot, rad
    gain : relative error of the output; offset : (3,), output unit
    """

    gravity: float = 0.0
    level: tuple[float, float] = (0.0, 0.0)
    orthogonality: float = 0.0
    outer: Array | float = 0.0
    inner: Array | float = 0.0
    temperature: Array | float = 0.0
    seat: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gain: float = 0.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def times(self, size: float) -> "Errors":
        """The errors times a factor."""
        scaled: dict[str, Any] = {
            name: tuple(size * v for v in value) if isinstance(value, tuple) else size * value
            for name, value in vars(self).items()
        }
        return Errors(**scaled)


@dataclass(frozen=True)
class InputQuantity:
    """One input quantity with its standard uncertainty.

    contribution : the entry of the budget that it belongs to; several influences may belong to one
    errors : of size one, in the unit of ``u``
    u : standard uncertainty; scope : for whom the value is common; dof : degrees of freedom of ``u``
    seen : whether the scatter of the dwells shows it already, so that it is not counted again
    """

    contribution: str
    errors: Errors
    u: float
    scope: str = "station"
    dof: float = float("inf")
    seen: bool = False


@dataclass(frozen=True)
class Scattered:
    """An error of the angles of single poses: standard uncertainties of outer and inner angle, rad.

    scope : ``station`` or ``run`` where it is the same at every visit of a pose; otherwise it is drawn anew at every dwell
    """

    contribution: str
    outer: float
    inner: float
    scope: str = "pose"
    dof: float = float("inf")
    seen: bool = False


@dataclass(frozen=True)
class Sensitivity:
    """Change of the outputs per standard uncertainty of every influence.

    changes : (..., n, 3, q), output unit: J·u
    contributions, dof, seen : of the q columns
    """

    changes: Array
    contributions: tuple[str, ...]
    dof: tuple[float, ...]
    seen: tuple[bool, ...]


@dataclass(frozen=True)
class MeasurementModel:
    """A calibrated model: its output under any force and temperature.

    effects : ids; coefficients : (..., 3, p); nonlinear : by effect id
    """

    effects: Sequence[str]
    coefficients: Array
    nonlinear: Values

    def output(self, state: State, errors: Errors) -> Array:
        """True output (..., n, 3) of dwells that are recorded as ``state`` while the station has these errors."""
        force = true_force(state, errors)
        moved = replace(state, force=force, memory={})
        if state.temperature is not None and np.any(errors.temperature):
            moved = replace(moved, temperature=state.temperature - errors.temperature)
        out = predict(self.effects, moved, self.coefficients, self.nonlinear)
        return out * (1.0 + errors.gain) + of_axes(np.asarray(errors.offset), state.axes, -1)


def true_force(state: State, errors: Errors) -> Array:
    """True specific force, (..., n, 3), g, of dwells recorded as ``state``: (Rx(α')·Ry(η)·Rz(β'))ᵀ·up, then the slot."""
    if state.outer is None or state.inner is None:
        raise ValueError("dwells without angles: the station's errors cannot be propagated")
    size = np.linalg.norm(state.force, axis=-1, keepdims=True)
    alpha, beta = _of_one(state.outer + errors.outer), _of_one(state.inner + errors.inner)
    up = np.array([errors.level[0], errors.level[1], 1.0])
    c, s = np.cos(errors.orthogonality), np.sin(errors.orthogonality)
    between = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    turned = np.einsum("...ji,j->...i", rotation_x(alpha) @ between @ rotation_z(beta), up)
    return (1.0 + errors.gravity) * size * (turned @ slot_rotation(errors.seat).T)


def _of_one(angle: Array) -> Array:
    """The angles (n,) of one unit where all units (..., n) have equal ones, as on one table; else as they are."""
    rows = angle.reshape(-1, angle.shape[-1]) if angle.ndim > 1 else angle
    return (
        rows[0]
        if angle.ndim > 1 and len(rows) and np.array_equal(rows, np.broadcast_to(rows[0], rows.shape))
        else angle
    )


def slot_rotation(vector: Sequence[float]) -> Array:
    """Rotation (3, 3) of a small rotation vector, to second order, rad."""
    x, y, z = vector
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + k + 0.5 * k @ k


def harmonic(angle: Array, order: int, phase: str) -> Array:
    """sin(n·angle) or cos(n·angle), the shape of an eccentric encoder."""
    return np.sin(order * angle) if phase == "sin" else np.cos(order * angle)


def sensitivity(
    model: MeasurementModel, state: State, influences: Sequence[InputQuantity], scattered: Sequence[Scattered] = ()
) -> Sensitivity:
    """J·u of all influences, by central differences of the predicted output at the fitted coefficients.

    Parameters
    ----------
    scattered : errors of single dwells or poses; each gives two columns for each of them
    """
    entered: list[tuple[Array, InputQuantity | Scattered]] = [
        (influence.u * difference(model, state, influence.errors)[..., None], influence) for influence in influences
    ]
    for scatter in scattered:
        for size, errors in ((scatter.outer, Errors(outer=1.0)), (scatter.inner, Errors(inner=1.0))):
            if size > 0.0:
                change = size * difference(model, state, errors)
                every = np.arange(change.shape[-2])
                drawn = poses_of(state) if scatter.scope in SAME_AT_EVERY_VISIT else every
                single = np.zeros((*change.shape, int(drawn.max(initial=-1)) + 1))
                single[..., every, :, drawn] = np.moveaxis(change, -2, 0)
                entered.append((single, scatter))
    if entered:
        changes = np.concatenate([columns for columns, _ in entered], axis=-1)
    else:
        changes = np.zeros((*predict(model.effects, state, model.coefficients, model.nonlinear).shape, 0))
    sources = [source for columns, source in entered for _ in range(columns.shape[-1])]
    return Sensitivity(
        changes,
        tuple(source.contribution for source in sources),
        tuple(source.dof for source in sources),
        tuple(source.seen for source in sources),
    )


def poses_of(state: State) -> Places:
    """Number of the pose of each dwell (n,): dwells whose angles no gap beyond :data:`APART_DEG` parts are of one pose."""
    if state.outer is None or state.inner is None:
        raise ValueError("dwells without angles: their poses are not known")
    levels = np.zeros((2, state.outer.shape[-1]), dtype=np.intp)
    for level, angle in zip(levels, (state.outer, state.inner), strict=True):
        degrees = np.degrees(angle.reshape(-1, angle.shape[-1])[0])
        order = np.argsort(degrees)
        level[order[1:]] = np.cumsum(np.diff(degrees[order]) > APART_DEG)
    return np.unique(levels, axis=1, return_inverse=True)[1].reshape(-1)


def difference(model: MeasurementModel, state: State, errors: Errors) -> Array:
    """Change of the outputs (..., n, 3) per unit of some errors."""
    step = STEP_K if np.any(errors.temperature) else STEP
    return (model.output(state, errors.times(step)) - model.output(state, errors.times(-step))) / (2.0 * step)


def theta(state: State) -> Array:
    """θ = T − 25 °C as it is read, (..., n); zero without a thermometer."""
    if state.temperature is None:
        return np.zeros(state.force.shape[:-1])
    return state.temperature - T_REFERENCE
