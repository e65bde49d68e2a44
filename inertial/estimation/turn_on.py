"""Allowance for a power cycle of the devices: their bias need not return to its value."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.estimation.term import Term
from inertial.power import switched
from inertial.state import State


class TurnOnBias(SensorEffect):
    """Bias that differs from one power-on to the next: not an effect to search for, but one to allow for."""

    id: ClassVar[str] = "turn_on_bias"
    symbol: ClassVar[str] = "kP"
    equation: ClassVar[str] = "kP·[since the n-th power-on]"
    source: ClassVar[str] = "repeatability of the bias, IEEE Std 1293-1998"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 1000.0)
    breaker: ClassVar[str] = "the same pose before and after"

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        """A step at every power-on but the first, (..., n, p)."""
        dwell = np.arange(state.time.shape[-1])
        steps = [np.broadcast_to((dwell >= k).astype(float), state.time.shape) for k in switched(state)]
        return stack(state, steps) if steps else np.zeros((*state.time.shape, 0))

    def names(self, axis: int) -> tuple[str, ...]:
        """Its one name."""
        return ("kP",)


TURN_ON = Term(TurnOnBias())


def with_turn_on(state: State, terms: Sequence[Term]) -> list[Term]:
    """Terms, and the bias of every power-on beside them where the state has more than one."""
    named = any(t.effect.id == TURN_ON.effect.id for t in terms)
    return [*terms] if named or not switched(state) else [*terms, TURN_ON]
