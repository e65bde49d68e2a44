"""Aims of a next measurement: to separate rival effects, or to show unseen effects."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from inertial.arrays import Array, Flags
from inertial.decisions import CLASS_WIDTH
from inertial.estimation.comparison import Fitting
from inertial.estimation.model import Model
from inertial.estimation.penalty import freedom, price
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term, with_turn_on
from inertial.next_measurement.separation import (
    Apart,
    Rivals,
    apart,
    predictions,
    residual_squares,
    widened,
)
from inertial.planning.sequences import SequenceStep, StationPace

UNLUCKY = 1.65
"""Standard deviations by which chance may be unfavourable while the measurement still separates the rivals."""

LEAST_WEIGHT = 0.02

_SHOWN = 36.0
"""Chi-square per coefficient at which an effect of typical size counts as visible: six standard errors."""


@dataclass(frozen=True)
class Promise:
    """Expected result of steps.

    before, after : chi-square between two rivals, the smaller of the values if either is true; per coefficient of unseen effects
    ids : the best rival and the nearest one that is separated from it; or the effects that become visible
    if_true : id and expected chi-square between the two, for each of them being true
    remaining : rivals that are not separated from the best
    """

    before: float
    after: float
    ids: tuple[str, ...]
    if_true: tuple[tuple[str, float], ...] = ()
    remaining: tuple[str, ...] = ()


Score = Callable[[Flags], Array]
"""Function of the measured dwells (n,), as flags, that gives the gain of each step of a grid, (grid,)."""


class Objective(ABC):
    """The aim of measurements; ``least`` is the smallest share of the aim that a further sequence must add.

    Parameters
    ----------
    rivals : the rivals, with the measurements of a few units
    terms : the effects to separate or to show
    """

    least: ClassVar[float]

    def __init__(self, rivals: Rivals, terms: Sequence[Term]) -> None:
        self.rivals, self.terms, self.lot = rivals, tuple(terms), rivals.lot

    @abstractmethod
    def worth(self, steps: Sequence[SequenceStep], pace: StationPace, *, fine: bool = False) -> float:
        """Share, 0 … 1, of the aim that is reached after these steps; ``fine``: accurate, as reported, instead of fast."""

    @abstractmethod
    def score(self, problem: Problem, grid: slice) -> Score:
        """The :data:`Score` of steps whose dwells in ``problem`` are the slice ``grid``."""

    @abstractmethod
    def effect_of_steps(
        self, already: Sequence[SequenceStep], steps: Sequence[SequenceStep], pace: StationPace
    ) -> Promise:
        """The expected result of ``steps`` measured after ``already``."""

    def picks(
        self, held: Sequence[SequenceStep], grid: Sequence[SequenceStep], pace: StationPace, count: int
    ) -> list[SequenceStep]:
        """Up to ``count`` steps of a grid, chosen one after the other, each the best when those before it are measured."""
        problem = widened(self.rivals, [*held, *grid], pace)
        n = problem.n - len(grid)
        score, train = self.score(problem, slice(n, None)), np.arange(problem.n) < n
        chosen: list[SequenceStep] = []
        for _ in range(min(count, len(grid))):
            gains = score(train)
            gains[train[n:]] = -1.0
            best = int(np.argmax(gains))
            train[n + best] = True
            chosen.append(grid[best])
        return chosen


class RivalDiscrimination(Objective):
    """Separation of rivals: for each as the truth, weighted by its probability, every other must leave enough chi-square."""

    least = 0.03

    def __init__(self, rivals: Rivals, scores: Array, every: Rivals | None = None, never: Flags | None = None) -> None:
        super().__init__(rivals, rivals.terms)
        self.every = every or rivals
        # (r, r): pairs that no measurement can separate are excluded
        self.never = np.eye(len(scores), dtype=bool) if never is None else never | np.eye(len(scores), dtype=bool)
        self.weight = np.maximum(np.exp(-0.5 * scores), LEAST_WEIGHT)
        self.needed = _needed(rivals, apart(rivals, fine=False))
        self._begun: dict[bool, Array] = {}

    def worth(self, steps: Sequence[SequenceStep], pace: StationPace, *, fine: bool = False) -> float:
        """Weighted mean over pairs of rivals of the share of the required chi-square that is reached after these steps."""
        gap, needed = self.expected(steps, pace, fine=fine)
        open_pairs = self.weight[:, None] * ~self.never
        return float(np.sum(open_pairs * np.clip(gap / needed, 0.0, 1.0)) / max(float(np.sum(open_pairs)), 1e-12))

    def expected(self, steps: Sequence[SequenceStep], pace: StationPace, *, fine: bool = True) -> tuple[Array, Array]:
        """Expected and required chi-square, (r, r) each, for the rival of a row as the truth against that of a column.

        The present measurements contribute their observed chi-square, new steps their expected one.
        """
        rivals = self.every if fine else self.rivals
        if fine not in self._begun:
            self._begun[fine] = apart(rivals, fine=fine).left
        if not steps:
            return rivals.observed, _needed(rivals, apart(rivals, fine=fine))
        separation = apart(rivals, steps, pace, fine=fine)
        return rivals.observed + np.maximum(separation.left - self._begun[fine], 0.0), _needed(rivals, separation)

    def score(self, problem: Problem, grid: slice) -> Score:
        """The score of steps by how much the rivals' predictions differ after a fit to the measured dwells."""
        rivals = self.rivals
        truths = predictions(rivals, problem)
        rest = with_turn_on(problem.lot.state, rivals.rest)
        fits = [Fitting(problem, [*rest, wrong]) for wrong in rivals.terms]
        error = _error(problem, rivals)[:, grid, None]

        def separation(train: Flags) -> Array:
            total = np.zeros(error.shape[1])
            for column, fit in enumerate(fits):
                left = fit.left(truths, train)[:, grid] / error
                gained = np.sum(left**2, axis=0) * rivals.weight / rivals.variance  # (grid, truths)
                gained[:, self.never[:, column]] = 0.0
                total += np.minimum(gained / self.needed[:, column], 1.0) @ self.weight
            return total

        return separation

    def effect_of_steps(
        self, already: Sequence[SequenceStep], steps: Sequence[SequenceStep], pace: StationPace
    ) -> Promise:
        """The best rival and the nearest that is separated from it, for either being true."""
        before, _ = self.expected(already, pace)
        after, needed = self.expected([*already, *steps], pace)
        names = self.rivals.ids
        sure = np.minimum(after / needed, (after / needed).T)[0, 1:]
        separable = [k for k in range(1, len(names)) if sure[k - 1] >= 1.0]
        other = separable[0] if separable else 1 + int(np.argmax(sure))
        both = (names[0], float(after[0, other])), (names[other], float(after[other, 0]))
        return Promise(
            before=float(max(before[0, other], 0.0)),
            after=min(chi for _, chi in both),
            ids=(names[0], names[other]),
            if_true=both,
            remaining=tuple(names[k] for k in range(1, len(names)) if k not in separable),
        )


class Sighting(Objective):
    """Unseen effects made visible: each coefficient, at the effect's typical size, by six standard errors."""

    least = 0.1

    def worth(self, steps: Sequence[SequenceStep], pace: StationPace, *, fine: bool = False) -> float:
        """Mean over the effects of the share of the required chi-square."""
        return float(np.mean(np.minimum(self.shown(steps, pace) / _SHOWN, 1.0)))

    def shown(self, steps: Sequence[SequenceStep], pace: StationPace) -> Array:
        """Chi-square per coefficient of each effect at its typical size, (effects,)."""
        rivals = self.rivals
        problem = widened(rivals, steps, pace) if steps else Problem(rivals.lot)
        columns, sizes = _typical(problem, self.terms)
        rest = with_turn_on(problem.lot.state, rivals.rest)
        noise = problem.covariance.rescaled(rivals.noise, rivals.covariance)
        left = residual_squares(Model(problem, rest), columns, noise)
        per_column = left * rivals.weight / rivals.variance / problem.blocks
        return np.array([float(np.mean(part)) for part in np.split(per_column, np.cumsum(sizes)[:-1])])

    def score(self, problem: Problem, grid: slice) -> Score:
        """The score of steps by the size of the effects beyond the model."""
        rivals = self.rivals
        columns, _ = _typical(problem, self.terms)
        fit = Fitting(problem, with_turn_on(problem.lot.state, rivals.rest))
        error = _error(problem, rivals)[:, grid, None]

        def shown(train: Flags) -> Array:
            left = fit.left(columns, train)[:, grid] / error
            gained = np.sum(left**2, axis=0) * rivals.weight / rivals.variance / problem.blocks
            return np.sum(np.minimum(gained / _SHOWN, 1.0), axis=1)

        return shown

    def effect_of_steps(
        self, already: Sequence[SequenceStep], steps: Sequence[SequenceStep], pace: StationPace
    ) -> Promise:
        """Chi-square per coefficient of the least visible effect, before and after; and the visible effects."""
        before, after = self.shown(already, pace), self.shown([*already, *steps], pace)
        will = after >= max(1.0, 0.5 * min(_SHOWN, float(np.max(after))))
        names = tuple(t.effect.id for t, there in zip(self.terms, will, strict=True) if there)
        return Promise(float(before[will].min()), float(after[will].min()), names)


def _typical(problem: Problem, terms: Sequence[Term]) -> tuple[Array, list[int]]:
    """Columns of effects scaled to their typical size, (blocks, n, all), g, and the number of columns of each effect.

    The largest value of a column is the geometric mean of the effect's usual range.
    """
    scaled: list[Array] = []
    for term in terms:
        columns = term.columns(problem)
        largest = np.max(np.abs(columns), axis=(0, 1))
        low, high = term.effect.typical_ug
        size = 1e-6 * float(np.sqrt(max(low, 1e-3) * high))
        scaled.append(columns * np.where(largest > 0.0, size / np.where(largest > 0.0, largest, 1.0), 0.0))
    return np.concatenate(scaled, axis=-1), [f.shape[-1] for f in scaled]


def _error(problem: Problem, rivals: Rivals) -> Array:
    """White standard errors (blocks, n), g, at the fitted noise; infinite where a dwell is missing."""
    return np.where(np.isfinite(problem.error), problem.error * rivals.noise.scale[:, None], np.inf)


def _needed(rivals: Rivals, separation: Apart) -> Array:
    """Chi-square (r, r) that excludes a wrong rival (column) if the rival of the row is true.

    The observed difference has a standard deviation of twice its root; a simpler rival has the lower price.
    """
    counts = [_coefficients(rivals, t) for t in rivals.terms]
    paid = np.array([price(d, k) for d, k in zip(separation.whole, counts, strict=True)])
    wrong = np.array([[price(max(d - lost, 0.0), k) for k, lost in zip(counts, row, strict=True)]
                      for d, row in zip(separation.whole, separation.left, strict=True)])  # fmt: skip
    least = np.maximum(CLASS_WIDTH + paid[:, None] - wrong, CLASS_WIDTH)
    return (UNLUCKY + np.sqrt(UNLUCKY**2 + least)) ** 2


def _coefficients(rivals: Rivals, term: Term) -> float:
    """Number of coefficients of a rival in the complete lot, including initial states of memories and nonlinear parameters."""
    problem = Problem(rivals.lot)
    columns = term.columns(problem).shape[-1] + term.start(problem).shape[-1]
    blocks = 1.0 if term.shared else problem.blocks * rivals.weight
    return blocks * columns + freedom(term)
