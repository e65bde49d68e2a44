"""Output that creeps to its new value after a change of specific force."""

from typing import ClassVar

import numpy as np

from inertial import frames, operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State

_SPEED = np.radians(25.0)
"""Of the table on its way, rad/s. The directions on the way matter, their times little: with 60 °/s in place of 20 °/s the fit of
a creep of 17 s loses 2 % of its reduction."""

_PARTS = 12
"""Of the way between two poses."""


class CreepAfterMove(SensorEffect):
    """Output that creeps to its new value after a change of specific force."""

    id: ClassVar[str] = "creep_after_move"
    symbol: ClassVar[str] = "kC"
    equation: ClassVar[str] = "kC·ΣΔfi·exp(−s/τ), over all moves so far, and the way of the table if way = 1"
    source: ClassVar[str] = "mechanism: viscoelastic hinge or adhesive (one Maxwell element)"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 5000.0)
    per: ClassVar[tuple[str, ...]] = ("g",)
    hides_behind: ClassVar[tuple[str, ...]] = ("pose_hysteresis",)
    breaker: ClassVar[str] = "waits of different length after a move"
    simplicity: ClassVar[int] = 32
    memory: ClassVar[bool] = True
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (
        Nonlinear("tau", "s", 2.0, 2000.0, "log", 12),
        Nonlinear("way", "1", 0.0, 1.0, choices=(0.0, 1.0)),
    )

    def columns(self, state: State, axis: int, *, tau: float, way: float = 0.0, **nonlinear: float) -> Array:
        """Design column of one axis: what is left of all changes of force.

        tau : s; way : 1 if the force follows the table from pose to pose, 0 if it changes at the end of each move
        """
        del nonlinear
        since = np.full_like(state.time, 1.0) if state.since_move is None else state.since_move
        kick = _on_arrival(state, axis, tau, since) if way else state.force_step[..., axis]
        left = state.remember((self.id, axis, tau, way), lambda: operators.relaxation(state.time, since, kick, tau))
        return stack(state, [left])

    def start_columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:
        del axis, nonlinear
        return stack(state, [np.exp(-(state.time - state.time[..., :1]) / tau)])

    def names(self, axis: int) -> tuple[str, ...]:
        del axis
        return ("kC",)


def _on_arrival(state: State, axis: int, tau: float, since: Array) -> Array:
    """What is left, at the end of each move, of the changes of force on its way, (..., n), g.

    Both axes turn together; where the angles are not recorded, the force changes at the end of the move.
    """
    step = state.force_step[..., axis]
    if state.outer is None or state.inner is None:
        return step
    at = np.stack(np.broadcast_arrays(state.outer, state.inner), axis=-1)
    turned = np.zeros_like(at)
    turned[..., 1:, :] = np.diff(at, axis=-2)
    between = np.zeros_like(since + step)
    between[..., 1:] = np.diff(np.broadcast_to(state.time, between.shape), axis=-1)
    seconds = np.minimum(np.max(np.abs(turned), axis=-1) / _SPEED, np.maximum(between - since, 0.0))
    part = np.arange(_PARTS + 1) / _PARTS
    ways = at[..., None, :] - (1.0 - part[:, None]) * turned[..., None, :]
    force = frames.force_from_angles(ways[..., 0], ways[..., 1])[..., axis]
    changes = np.diff(force, axis=-1)
    middle = 1.0 - 0.5 * (part[1:] + part[:-1])
    lost = np.sum(changes * -np.expm1(-seconds[..., None] * middle / tau), axis=-1)
    return step - lost
