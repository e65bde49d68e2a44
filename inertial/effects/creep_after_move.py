import numpy as np

from inertial import frames, operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State

_SPEED = np.radians(25.0)
"""Of the table on its way, rad/s. The directions on the way matter, their times little: with 60 °/s in place of 20 °/s the fit of
a creep of 17 s loses 2 % of its reduction."""

_PARTS = 12
"""Of the way between two poses."""

_MIDDLE = 1.0 - (np.arange(_PARTS) + 0.5) / _PARTS
"""Part of the way that is still to go in the middle of each part."""


class CreepAfterMove(SensorEffect):
    """Output that creeps to its new value after a change of specific force."""

    id = "creep_after_move"
    symbol = "kC"
    equation = "kC·ΣΔfi·exp(−s/τ), over all moves so far; way = 1: over all steps of the table between two poses"
    coefficients = ("kC",)
    source = "mechanism: viscoelastic hinge or adhesive (one Maxwell element)"
    typical_ug = (10.0, 5000.0)
    per = ("g",)
    hides_behind = ("pose_hysteresis",)
    breaker = "waits of different length after a move"
    simplicity = 32
    memory = True
    nonlinear = (
        Nonlinear("tau", "s", 2.0, 2000.0, "log", 12),
        Nonlinear("way", "1", 0.0, 1.0, choices=(0.0, 1.0)),
    )

    def columns(self, state: State, axis: int, *, tau: float, way: float = 0.0, **nonlinear: float) -> Array:
        """Design column of one axis: what is left of all changes of force.

        tau : s; way : 1 if the force follows the table from pose to pose, 0 if it changes at the end of each move
        """
        since = np.full_like(state.time, 1.0) if state.since_move is None else state.since_move

        def left() -> Array:
            kick = _on_arrival(state, axis, tau, since) if way else state.force_step[..., axis]
            return operators.relaxation(state.time, since, kick, tau)

        return stack(state, [state.remember((self.id, axis, tau, way), left)])

    def start_columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:
        return stack(state, [np.exp(-(state.time - state.time[..., :1]) / tau)])


def _on_arrival(state: State, axis: int, tau: float, since: Array) -> Array:
    """What is left, at the end of each move, of the changes of force on its way, (..., n), g.

    Both axes turn together; where the angles are not recorded, the force changes at the end of the move.
    """
    step = state.force_step[..., axis]
    if state.outer is None or state.inner is None:
        return step
    outer, inner = _once(state.outer), _once(state.inner)
    alike = len(outer) == len(inner) == 1
    key = (CreepAfterMove.id, "changes on the way")
    # one array for every τ and axis, and small where all units are on one table
    changes = state.remember(key, lambda: _changes(outer, inner)) if alike else _changes(outer, inner)
    turned = np.maximum(*(np.abs(np.diff(angle, axis=-1, prepend=angle[..., :1])) for angle in (outer, inner)))
    time, after = _once(state.time), _once(since)
    between = np.diff(time, axis=-1, prepend=time[..., :1])
    seconds = np.minimum(turned / _SPEED, np.maximum(between - after, 0.0))
    left = -np.expm1(-seconds[..., None] * _MIDDLE / tau)
    return step - np.sum(changes[..., axis] * left, axis=-1)


def _changes(outer: Array, inner: Array) -> Array:
    """Changes of force in the parts of the way to each pose, (..., n, parts, 3), g, at angles (..., n), rad."""
    part = 1.0 - np.arange(_PARTS + 1) / _PARTS
    ways = [
        angle[..., None] - part * np.diff(angle, axis=-1, prepend=angle[..., :1])[..., None] for angle in (outer, inner)
    ]
    return np.diff(frames.force_from_angles(*ways), axis=-2)


def _once(values: Array) -> Array:
    """Values (units, n), one row where those of all units are equal."""
    return values[:1] if values.ndim > 1 and bool(np.all(values == values[:1])) else values
