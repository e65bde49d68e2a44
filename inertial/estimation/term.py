"""An effect in a model, at values of its nonlinear parameters."""

from dataclasses import dataclass

from inertial.effects.base import AnyEffect
from inertial.estimation.alternative import Handling
from inertial.estimation.candidate import Candidate
from inertial.estimation.problem import SHARED, Problem


@dataclass(frozen=True)
class Term:
    """An effect in a model, at values of its nonlinear parameters.

    values : of nonlinear parameters and constants; one value, or one per sensor axis
    first : how many of its columns are used; None for all
    rest : whether its memory was at rest before the first dwell; its state then is unknown otherwise
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
        """Whether the effect depends on what was before the first dwell."""
        return not isinstance(self.effect, Handling) and self.effect.memory

    @property
    def key(self) -> tuple[object, ...]:
        """The term as a key; effects are known by their ids."""
        return self.effect.id, self.values, self.first, self.rest

    @property
    def keywords(self) -> dict[str, float | tuple[float, ...]]:
        """Values as keywords of the effect's columns."""
        return dict(self.values)

    def candidate(self, problem: Problem) -> Candidate:
        """The term's columns in a problem, as a candidate."""
        return problem.candidate(self.effect, [self.keywords], first=self.first)
