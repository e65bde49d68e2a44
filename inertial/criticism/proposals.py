"""The next measurement: the steps that part rivals that fit alike, per minute of the station's time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.classes import TOLD_APART, EffectClass
from inertial.criticism.heldout import Fitting
from inertial.criticism.menus import Course, Kind, Reach, courses, pose_grid, present, reach_of, temperatures
from inertial.criticism.model import Model, Term
from inertial.criticism.penalty import cost_of, freedom
from inertial.criticism.separation import Rivals, predictions, rivals_of, separations, smallest, widened
from inertial.sequences import Pace, Step, standing, timeline

Array = NDArray[np.float64]

_MEMBERS = 6
_PICKS = 12
_SIZES = (3, 6, 12)
_REPEATS = (1, 2, 4)
_ROUNDS = 4
_WORTH = 0.03
"""Share of all that is wanted that a further course must bring."""

_UNLUCKY = 1.65
"""Standard deviations of bad luck that the measurement must stand."""

_MARGIN = 1.5
"""Rivals are refitted with other nonlinear parameters afterwards: that costs separation."""

_LEAST_WEIGHT = 0.02

Minutes = Callable[[Sequence[Step]], float]


@dataclass(frozen=True)
class Proposal:
    """Steps to measure next.

    pairs : for each step, the two rivals that it parts most
    minutes : of station time
    before, after : chi-square expected between the best rival and its nearest, whichever is true
    settled : share of all that is wanted that will be there afterwards, 0 … 1
    """

    kinds: tuple[Kind, ...]
    steps: tuple[Step, ...]
    ids: tuple[str, ...]
    pairs: tuple[tuple[str, str], ...]
    minutes: float
    before: float
    after: float
    settled: float

    @property
    def repeats(self) -> dict[Step, int]:
        """How often each step is taken."""
        return {step: self.steps.count(step) for step in self.steps}


@dataclass(frozen=True)
class Circumstances:
    """What a proposal may use: the station's reach and pace, its time for steps, and the minutes that may be spent."""

    reach: Reach | None = None
    pace: Pace = field(default_factory=Pace)
    minutes: Minutes | None = None
    budget: float = float("inf")

    def cost(self, rivals: Rivals, steps: Sequence[Step]) -> float:
        """Minutes of station time that steps take after the run."""
        if not steps:
            return 0.0
        if self.minutes is not None:
            return self.minutes(steps)
        state = rivals.lot.state
        return timeline(steps, self.pace, self.pace.start or standing(state), present(state, self.pace)).end / 60.0


def rivals_in(model: Model, group: EffectClass) -> Rivals | None:
    """The members of a class as rivals; None for a class of one, and where no angles say how to go on."""
    state = model.problem.lot.state
    if len(group.members) < 2 or state.outer is None or state.inner is None or model.problem.lot.radial:
        return None
    others = [t for t in model.terms if t.effect.id not in group.ids]
    return rivals_of(model, [m.term for m in group.members[:_MEMBERS]], others)


def proposal(
    model: Model, group: EffectClass, around: Circumstances | None = None, already: Sequence[Step] = ()
) -> Proposal | None:
    """The steps that best part the members of a class; None where nothing the station does parts them.

    Parameters
    ----------
    already : steps that are to be measured anyway, for another class; the proposal comes after them
    """
    rivals = rivals_in(model, group)
    if rivals is None:
        return None
    around = around or Circumstances()
    scores = np.array([m.score for m in group.members[:_MEMBERS]])
    return _Search(rivals, scores, around, already).best()


class _Search:
    """The choice of courses for one class."""

    def __init__(self, rivals: Rivals, scores: Array, around: Circumstances, already: Sequence[Step]) -> None:
        self.rivals, self.around, self.already = rivals, around, tuple(already)
        self.reach = around.reach or reach_of(rivals.lot.state)
        self.weight = np.maximum(np.exp(-0.5 * scores), _LEAST_WEIGHT)
        self.needed = _needed(rivals)
        self.before = separations(rivals, self.already, around.pace)

    def worth(self, left: Array) -> float:
        """Share of what is wanted that separations bring, 0 … 1: each truth by how likely it is, none counted beyond need."""
        off = ~np.eye(len(left), dtype=bool)
        share = np.minimum(left / self.needed, 1.0) * off
        return float(np.sum(self.weight[:, None] * share) / np.sum(self.weight[:, None] * off))

    def best(self) -> Proposal | None:
        """Courses one after the other, each the best beside those before it, until all is parted or nothing more helps."""
        chosen: list[Course] = []
        now = self.worth(self.before)
        for _ in range(_ROUNDS):
            found = self._next(chosen, now) if now <= 1.0 - _WORTH else None
            if found is None:
                break
            course, now = found
            chosen.append(course)
        if not chosen:
            return None
        return self._told(chosen, now)

    def _next(self, chosen: Sequence[Course], now: float) -> tuple[Course, float] | None:
        """The course that brings most per minute beside those chosen; the cheapest of those that part everything."""
        held = [*self.already, *(s for c in chosen for s in c.steps)]
        spent = self.around.cost(self.rivals, held)
        best: tuple[float, Course, float] | None = None
        for course in self._offers(held):
            minutes = self.around.cost(self.rivals, [*held, *course.steps])
            if minutes > self.around.budget:
                continue
            worth = self.worth(separations(self.rivals, [*held, *course.steps], self.around.pace))
            if worth - now < _WORTH:
                continue
            # what is beyond the last part of the need is not worth much more time
            rate = (worth - now) / (minutes - spent + 1.0)
            if best is None or rate > best[0]:
                best = rate, course, worth
        return None if best is None else (best[1], best[2])

    def _offers(self, held: Sequence[Step]) -> list[Course]:
        """Every course that is worth a look."""
        state = self.rivals.lot.state
        here = held[-1].temperature if held else present(state, self.around.pace)
        picks = self._picked(held, here)
        offers = [Course("poses", tuple(picks[:size])).times(r) for size in _SIZES for r in _REPEATS]
        for temperature in temperatures(here, self.reach):
            further = self._picked(held, temperature)
            offers += [Course("soaks", tuple(further[:size])) for size in _SIZES]
        return [*offers, *courses(state, self.reach, picks, here)]

    def _picked(self, held: Sequence[Step], temperature: float) -> list[Step]:
        """Poses at a temperature, each the one at which the rivals differ most once those before it are fitted."""
        grid = pose_grid(self.reach, temperature)
        rivals = self.rivals
        problem = widened(rivals, [*held, *grid], self.around.pace)
        n = problem.n - len(grid)
        train = np.arange(problem.n) < n
        truths = predictions(rivals, problem)
        fits = [Fitting(problem, [*rivals.rest, wrong]) for wrong in rivals.terms]
        error = np.where(np.isfinite(problem.error), problem.error, np.inf)[:, n:, None]
        chosen: list[Step] = []
        for _ in range(_PICKS):
            apart = np.zeros(len(grid))
            for column, fit in enumerate(fits):
                left = fit.left(truths, train)[:, n:] / error
                gained = np.sum(left**2, axis=0) * rivals.weight / rivals.variance  # (grid, truths)
                gained[:, column] = 0.0
                apart += np.minimum(gained / self.needed[:, column], 1.0) @ self.weight
            apart[train[n:]] = -1.0
            place = int(np.argmax(apart))
            train[n + place] = True
            chosen.append(grid[place])
        return chosen

    def _told(self, chosen: Sequence[Course], worth: float) -> Proposal:
        steps = [s for c in chosen for s in c.steps]
        whole = [*self.already, *steps]
        after = separations(self.rivals, whole, self.around.pace)
        before, later = smallest(self.before), smallest(after)
        names = self.rivals.ids
        nearest = [k for k in range(len(names)) if k]
        return Proposal(
            kinds=tuple(dict.fromkeys(c.kind for c in chosen)),
            steps=tuple(steps),
            ids=names,
            pairs=tuple([self._pair(later - before)] * len(steps)),
            minutes=self.around.cost(self.rivals, whole) - self.around.cost(self.rivals, self.already),
            before=float(min(before[0, k] for k in nearest)),
            after=float(min(later[0, k] for k in nearest)),
            settled=worth,
        )

    def _pair(self, gained: Array) -> tuple[str, str]:
        """The best rival and the one that it is parted from most, in the order of the class."""
        names = self.rivals.ids
        other = 1 + int(np.argmax(np.minimum(gained[0, 1:], self.needed[0, 1:])))
        return names[0], names[other]


def _needed(rivals: Rivals) -> Array:
    """Chi-square (r, r) that must lie between a truth (row) and a wrong rival (column) for the class to drop the wrong one.

    The difference found scatters by twice the root of its own size about it; a simpler rival has its penalty in its favour.
    """
    costs = np.array([_cost(t, c) for t, c in zip(rivals.terms, rivals.predicted, strict=True)])
    least = np.maximum(TOLD_APART + costs[:, None] - costs[None, :], TOLD_APART)
    return _MARGIN * (_UNLUCKY + np.sqrt(_UNLUCKY**2 + least)) ** 2


def _cost(term: Term, coefficients: Array) -> float:
    columns = int(coefficients.shape[-1])
    return cost_of(int(coefficients.size), columns, freedom(term))
