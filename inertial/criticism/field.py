"""The candidates of a search: effects at the values of their nonlinear parameters, handling errors at their locations."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.design import grid_of
from inertial.effects.base import AnyEffect
from inertial.errors import MissingInput
from inertial.estimation.alternative import Handling, OfOneDwell, by_block, of_outputs
from inertial.estimation.candidate import Candidate
from inertial.estimation.likelihood import Ratio
from inertial.estimation.problem import Problem
from inertial.estimation.space import Gain, Space
from inertial.estimation.term import Term


@dataclass(frozen=True)
class Rival:
    """A candidate at its best values, judged in addition to a model.

    drop : reduction of the deviance; rank : number of coefficients that the plan determines
    cost : price less reduction of the deviance, smaller is better; log_p : log probability that noise reduces it as much
    ratio : the likelihood ratio that these come from; None if there is none
    """

    term: Term
    drop: float
    rank: int
    cost: float
    log_p: float
    ratio: Ratio | None = None

    @staticmethod
    def of(term: Term, ratio: Ratio) -> "Rival":
        """The rival of a term and its likelihood ratio."""
        return Rival(term, ratio.deviance, ratio.rank, -ratio.score, ratio.log_p, ratio)

    def at(self, ratio: Ratio) -> "Rival":
        """The rival judged at the φ of another ratio, and at its shares of wander if they are better."""
        return self if self.ratio is None else Rival.of(self.term, self.ratio.at(ratio.shared, ratio.shares))


class Candidates:
    """The candidates whose required quantities are recorded in a lot.

    Parameters
    ----------
    effects : effects of the catalogue, and covariates
    handling : handling errors, the alternatives to them
    """

    def __init__(self, problem: Problem, effects: Iterable[AnyEffect], handling: Iterable[Handling] = ()) -> None:
        self.problem = problem
        self.effects: list[AnyEffect] = []
        self.handling: list[Handling] = []
        self.grids: dict[str, list[dict[str, float]]] = {}
        self.lacking: dict[str, str] = {}
        self._looked: dict[str, int] = {}
        self._single: dict[str, Array] = {}
        for effect in effects:
            try:
                grid = grid_of(effect, problem.lot.state)
                problem.first_unit.columns(effect, grid[0])
            except MissingInput as reason:
                self.lacking[effect.id] = reason.quantity
                continue
            self.effects.append(effect)
            self.grids[effect.id] = grid
        for alternative in handling:
            locations = [] if problem.lot.radial else alternative.locations(problem.lot)
            if locations and problem.lot.state.time.shape[0] >= alternative.fewest_units:
                self.handling.append(alternative)
                self.grids[alternative.id] = locations
                self._looked[alternative.id] = alternative.looks(problem.lot, len(locations))

    @property
    def looks(self) -> int:
        """Number of tests made in one pass: every effect at every value, every alternative at every location."""
        return sum(self._looked.get(name, len(grid)) for name, grid in self.grids.items())

    def of(self, name: str) -> AnyEffect | Handling:
        """The candidate of an id."""
        return next(e for e in (*self.effects, *self.handling) if e.id == name)

    def looks_of(self, name: str) -> int:
        """Number of locations that the price of a handling error counts; 1 for an effect."""
        return self._looked.get(name, 1)

    def gains(
        self, spaces: Sequence[Space], leave: set[str], *, handling: bool = False, primary: bool = False
    ) -> list[dict[str, Gain]]:
        """For each space the gain of every candidate by id; columns are computed once for all spaces.

        Parameters
        ----------
        leave : ids that are left out; handling : whether handling errors are included
        primary : whether only the leading columns are used, of effects for which these alone are a simpler effect
        """
        gains: list[dict[str, Gain]] = [{} for _ in spaces]
        for effect in (*self.effects, *(self.handling if handling else ())):
            first = effect.primary if primary else None
            if effect.id not in leave and (first is not None or not primary):
                for each, gain in zip(gains, self._gain(spaces, effect, first), strict=True):
                    each[effect.id] = gain
        return gains

    def gain_of(self, space: Space, effect: AnyEffect | Handling) -> Gain:
        """Gain of one candidate."""
        return self._gain([space], effect, None)[0]

    def _gain(self, spaces: Sequence[Space], effect: AnyEffect | Handling, first: int | None) -> list[Gain]:
        if isinstance(effect, OfOneDwell) and not self.problem.lot.radial:
            dwells = np.array([int(location["at"]) for location in self.grids[effect.id]])
            return [space.gain_of_dwells(self._every_dwell(effect), dwells) for space in spaces]
        pieces = self.problem.pieces(effect, self.grids[effect.id], first=first)
        parts = [[space.gain(piece) for space in spaces] for piece in pieces]
        return [Gain.joined(of_space) for of_space in zip(*parts, strict=True)]

    def _every_dwell(self, effect: OfOneDwell) -> Array:
        """Columns (blocks, n, p), g per unit of the coefficient, of a handling error in each of the n dwells."""
        if effect.id not in self._single:
            units, n = self.problem.lot.state.time.shape
            change = of_outputs(self.problem.lot, effect.every_dwell(self.problem.lot))
            self._single[effect.id] = by_block(np.broadcast_to(change, (units, n, *change.shape[2:])))
        return self._single[effect.id]

    def pieces(self) -> Iterator[Candidate]:
        """Every effect at every value of its nonlinear parameters, in pieces."""
        for effect in self.effects:
            yield from self.problem.pieces(effect, self.grids[effect.id])
