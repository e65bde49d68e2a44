"""Output that creeps to its new value after a change of specific force."""

from typing import ClassVar

import numpy as np

from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class CreepAfterMove(SensorEffect):
    """Output that creeps to its new value after a change of specific force."""

    id: ClassVar[str] = "creep_after_move"
    symbol: ClassVar[str] = "kC"
    equation: ClassVar[str] = "kC·ΣΔfi·exp(−s/τ), over all moves so far"
    source: ClassVar[str] = "mechanism: viscoelastic hinge or adhesive (one Maxwell element)"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 5000.0)
    per: ClassVar[tuple[str, ...]] = ("g",)
    hides_behind: ClassVar[tuple[str, ...]] = ("pose_hysteresis",)
    breaker: ClassVar[str] = "waits of different length after a move"
    simplicity: ClassVar[int] = 32
    memory: ClassVar[bool] = True
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("tau", "s", 2.0, 2000.0, "log", 12),)

    def columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:
        del nonlinear
        since = np.full_like(state.time, 1.0) if state.since_move is None else state.since_move
        left = state.remember(
            (self.id, axis, tau), lambda: operators.relaxation(state.time, since, state.force_step[..., axis], tau)
        )
        return stack(state, [left])

    def start_columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:
        del axis, nonlinear
        return stack(state, [np.exp(-(state.time - state.time[..., :1]) / tau)])

    def names(self, axis: int) -> tuple[str, ...]:
        del axis
        return ("kC",)
