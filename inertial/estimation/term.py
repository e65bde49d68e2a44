"""An effect in a model, at values of its nonlinear parameters; the allowance for a bias that differs after a power cycle."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.effects.base import AnyEffect, Array, SensorEffect, stack
from inertial.estimation.alternative import Handling
from inertial.estimation.candidate import Candidate
from inertial.estimation.problem import SHARED, Problem
from inertial.power import switched
from inertial.state import State


@dataclass(frozen=True)
class Term:
    """An effect in a model, at values of its nonlinear parameters.

    values : names and values of nonlinear parameters and constants; one value, or one per sensor axis
    first : number of leading columns that are used; None for all
    rest : whether a memory's state before the first dwell is known (at rest, or given by a parameter) and has no coefficients
    """

    effect: AnyEffect | Handling
    values: tuple[tuple[str, float | tuple[float, ...]], ...] = ()
    first: int | None = None
    rest: bool = False

    @property
    def shared(self) -> bool:
        """Whether all blocks share its coefficients."""
        return self.effect.scope in SHARED

    @property
    def memory(self) -> bool:
        """Whether the effect depends on the history before the first dwell."""
        return not isinstance(self.effect, Handling) and self.effect.memory

    @property
    def key(self) -> tuple[object, ...]:
        """A hashable key of the term; the effect is identified by its id."""
        return self.effect.id, self.values, self.first, self.rest

    @property
    def keywords(self) -> dict[str, float | tuple[float, ...]]:
        """Values as keywords of the effect's columns."""
        return dict(self.values)

    @property
    def location(self) -> dict[str, float]:
        """The location of a handling error in the lot: unit, dwell, soak or pose, as of its ``locations``."""
        return {name: value for name, value in self.values if isinstance(value, float)}

    def candidate(self, problem: Problem) -> Candidate:
        """The term's columns in a problem, as a candidate."""
        return problem.candidate(self.effect, [self.keywords], first=self.first)

    def columns(self, problem: Problem) -> Array:
        """The term's columns in a problem by block, (blocks, n, p), g per unit of the coefficient."""
        return problem.columns(self.effect, self.keywords)[..., : self.first]

    def start(self, problem: Problem) -> Array:
        """Columns (blocks, n, k) of the unknown state of its memory before the first dwell; none where it was at rest."""
        if self.rest:
            return np.zeros((problem.blocks, problem.n, 0))
        return problem.start(self.effect, self.keywords)


class TurnOnBias(SensorEffect):
    """Turn-on bias: differs from one power-on to the next. It is never searched for, but always allowed for."""

    id = "turn_on_bias"
    symbol = "kP"
    equation = "kP·[since the n-th power-on]"
    source = "repeatability of the bias, IEEE Std 1293-1998"
    typical_ug = (1.0, 1000.0)
    breaker = "the same pose before and after"

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        """A step at every power-on but the first, (..., n, p)."""
        dwell = np.arange(state.time.shape[-1])
        steps = [np.broadcast_to((dwell >= k).astype(float), state.time.shape) for k in switched(state)]
        return stack(state, steps) if steps else np.zeros((*state.time.shape, 0))

    def names(self, axis: int) -> tuple[str, ...]:
        """Name of the coefficient, equal on all axes."""
        return ("kP",)


TURN_ON = Term(TurnOnBias())


def with_turn_on(state: State, terms: Sequence[Term]) -> list[Term]:
    """The terms, with a turn-on bias added where the devices were switched on more than once."""
    named = any(t.effect.id == TURN_ON.effect.id for t in terms)
    return [*terms] if named or not switched(state) else [*terms, TURN_ON]
