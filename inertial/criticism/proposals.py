"""The next measurement: the steps that part rivals that fit alike, or show what was not seen, per minute of station time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from inertial import effects as catalogue
from inertial.criticism.aims import Objective, RivalDiscrimination, Sighting
from inertial.criticism.classes import EffectClass
from inertial.criticism.handling.base import Handling
from inertial.criticism.menus import Kind, Reach, StepSequence, courses, pose_grid, present, reach_of, temperatures
from inertial.criticism.model import Model, Term
from inertial.criticism.separation import FEW, MANY, Rivals, rivals_of
from inertial.criticism.twins import never_apart, twins_of
from inertial.design import grid_of
from inertial.errors import MissingInput
from inertial.planning.reasons import drivers_of
from inertial.planning.sequences import SequenceStep, StationPace, standing, timeline
from inertial.state import State

MICRO = 1e6

_MEMBERS = 6
_PICKS = 12
_SIZES = (3, 6, 12)
_REPEATS = (1, 2, 4)
_ROUNDS, _TRIED = 4, 4
_ALL = 0.999
"""Share of all that is wanted that counts as all of it."""

_KEPT = 0.5
"""Share of what an offer promises on the grid that must be there with every rival fitted."""

Minutes = Callable[[Sequence[SequenceStep]], float]


@dataclass(frozen=True)
class Proposal:
    """Steps to measure next.

    ids : the effects that it is about; pair : the two rivals that it parts most; empty where it shows what was not seen
    minutes : of station time
    before, after : chi-square between the two rivals so far, and expected with the steps whichever of them is true; of a
        coefficient of typical size for effects that were not seen
    if_true : the same by which of the two is true; remaining : rivals that are still not told apart from the best
    settled : share of all that is wanted that will be there afterwards, 0 … 1
    """

    kinds: tuple[Kind, ...]
    steps: tuple[SequenceStep, ...]
    ids: tuple[str, ...]
    pair: tuple[str, ...]
    minutes: float
    before: float
    after: float
    settled: float
    if_true: tuple[tuple[str, float], ...] = ()
    remaining: tuple[str, ...] = ()


@dataclass(frozen=True)
class Circumstances:
    """What a proposal may use: the station's reach and pace, its time for steps, and the minutes that may be spent."""

    reach: Reach | None = None
    pace: StationPace = field(default_factory=StationPace)
    minutes: Minutes | None = None
    budget: float = float("inf")

    def cost(self, aim: Objective, steps: Sequence[SequenceStep]) -> float:
        """Minutes of station time that steps take after the run."""
        if not steps:
            return 0.0
        if self.minutes is not None:
            return self.minutes(steps)
        state = aim.lot.state
        return timeline(steps, self.pace, self.pace.start or standing(state), present(state, self.pace)).end / 60.0


def rivals_in(model: Model, group: EffectClass, most: int = FEW) -> Rivals | None:
    """The members of a class as rivals; None for a class of one, and where no angles say how to go on."""
    if len(group.members) < 2 or not _goes_on(model):
        return None
    others = [t for t in model.terms if t.effect.id not in group.ids]
    return rivals_of(model, [m.term for m in group.members[:_MEMBERS]], others, most)


def proposal(
    model: Model, group: EffectClass, around: Circumstances | None = None, already: Sequence[SequenceStep] = ()
) -> Proposal | None:
    """The steps that best part the members of a class; None where nothing the station does parts two of them for sure.

    Parameters
    ----------
    already : steps that are to be measured anyway, for another class; the proposal comes after them
    """
    rivals, every = rivals_in(model, group), rivals_in(model, group, MANY)
    if rivals is None or every is None:
        return None
    around = around or Circumstances()
    never = never_apart(rivals, around.reach, around.pace)
    if never[0, 1:].all():
        return None
    scores = np.array([m.score for m in group.members[:_MEMBERS]])
    found = ProposalSearch(RivalDiscrimination(rivals, scores, every, never), around, already).best()
    # a measurement that may well tell nothing apart is not worth its station time
    return None if found is None or len(found.remaining) == len(rivals.terms) - 1 else replace(found, ids=rivals.ids)


def twins(model: Model, group: EffectClass, around: Circumstances | None = None) -> tuple[str, ...]:
    """The best member of a class and those that no measurement of the station parts from it; empty where there is none."""
    rivals = rivals_in(model, group)
    around = around or Circumstances()
    return () if rivals is None else twins_of(rivals, never_apart(rivals, around.reach, around.pace))


def sighting(
    model: Model, unseen: Sequence[str], around: Circumstances | None = None, already: Sequence[SequenceStep] = ()
) -> Proposal | None:
    """The steps that best show effects that the plan could not see; None where none matters, or the station can show none.

    An effect matters that has been seen to be larger than the noise that is there.
    """
    if not _goes_on(model):
        return None
    floor = MICRO * model.floor()
    around = around or Circumstances()
    state = model.problem.lot.state
    steady = (around.reach or reach_of(state)).temperature is None
    terms = [t for name in unseen if (t := _term(model, name)) is not None and t.effect.typical_ug[1] > floor]
    terms = [t for t in terms if not (steady and "temperature" in _drivers(state, t))]
    if not terms:
        return None
    rivals = rivals_of(model, [], model.terms)
    found = ProposalSearch(Sighting(rivals, terms), around, already).best()
    return None if found is None else replace(found, pair=())


def _goes_on(model: Model) -> bool:
    """Whether there are angles to go on from."""
    state = model.problem.lot.state
    return state.outer is not None and state.inner is not None and not model.problem.lot.radial


def _term(model: Model, name: str) -> Term | None:
    """An effect at the middle of its grid; None where the dwells lack what it needs."""
    effect, state = catalogue.get(name), model.problem.lot.state
    try:
        grid = grid_of(effect, state)
        model.problem.columns(effect, grid[0])
    except MissingInput:
        return None
    return Term(effect, tuple(grid[len(grid) // 2].items()))


def _drivers(state: State, term: Term) -> frozenset[str]:
    """What an effect answers to; nothing for what handling does."""
    return frozenset() if isinstance(term.effect, Handling) else frozenset(drivers_of(state, term.effect))


@dataclass(frozen=True)
class _Offer:
    """A course with what is there after it, the station time until then, and what it brings per minute."""

    course: StepSequence
    worth: float
    minutes: float
    rate: float


class ProposalSearch:
    """The choice of courses for one aim."""

    def __init__(self, aim: Objective, around: Circumstances, already: Sequence[SequenceStep]) -> None:
        self.aim, self.around, self.already = aim, around, tuple(already)
        self.state = aim.lot.state
        self.reach = around.reach or reach_of(self.state)
        self.pace = around.pace
        # dwells on the way shake everything that follows temperature: only for what answers to its rate
        answers = [_drivers(self.state, t) for t in aim.terms]
        self.rated = any("rate" in found for found in answers)
        self.timed = any("since_power" in found for found in answers)

    def best(self) -> Proposal | None:
        """Courses one after the other, each the best beside those before it, until all is there or nothing more helps.

        One course that brings all of it by itself takes their place where they take more time, or do not get there.
        """
        chosen: list[StepSequence] = []
        now = self.aim.worth(self.already, self.pace)
        whole: _Offer | None = None
        for turn in range(_ROUNDS):
            if now >= _ALL:
                break
            offers = self._weighed(chosen, now)
            if turn == 0:
                whole = min((o for o in offers if o.worth >= _ALL), key=lambda o: o.minutes, default=None)
            taken = self._kept(chosen, offers, now)
            if taken is None:
                break
            chosen, now = [*chosen, taken[0].course], taken[1]
        while chosen and now < _ALL and len(chosen) < 2 * _ROUNDS:
            # the grid shows no difference any more: what parts them once parts them better twice
            promised = self._promised([*chosen, chosen[0]])
            within = self._minutes([*chosen, chosen[0]]) <= self.around.budget
            if not within or promised - now < min(self.aim.least, 0.5 * (1.0 - now)):
                break
            chosen, now = [*chosen, chosen[0]], promised
        if whole is not None and (now < _ALL or self._minutes(chosen) > whole.minutes):
            promised = self._promised([whole.course])
            if promised >= min(now, _ALL):
                chosen, now = [whole.course], promised
        return self._told(chosen, now) if chosen else None

    def _kept(
        self, chosen: Sequence[StepSequence], offers: Sequence[_Offer], now: float
    ) -> tuple[_Offer, float] | None:
        """The offer that brings most per minute of those that keep what they promise, with what is there after it.

        On the grid alone the wrong rivals look further away than they are: an offer counts with every rival fitted, the best of
        each kind in turn. Where none keeps half of its promise, that which brings most.
        """
        by_kind: dict[str, _Offer] = {}
        for offer in sorted(offers, key=lambda o: -o.rate):
            by_kind.setdefault(offer.course.kind, offer)
        best: tuple[_Offer, float] | None = None
        for offer in list(by_kind.values())[:_TRIED]:
            promised = self._promised([*chosen, offer.course])
            if promised - now >= _KEPT * (offer.worth - now):
                return offer, promised
            if best is None or promised > best[1]:
                best = offer, promised
        return best if best is not None and best[1] - now >= min(self.aim.least, 0.5 * (1.0 - now)) else None

    def _promised(self, chosen: Sequence[StepSequence]) -> float:
        """What is there after courses, with every rival fitted as it will be."""
        return self.aim.worth([*self.already, *(s for c in chosen for s in c.steps)], self.pace, fine=True)

    def _minutes(self, chosen: Sequence[StepSequence]) -> float:
        return self.around.cost(self.aim, [*self.already, *(s for c in chosen for s in c.steps)])

    def _weighed(self, chosen: Sequence[StepSequence], now: float) -> list["_Offer"]:
        """Courses that help beside those chosen, and that the budget allows."""
        held = [*self.already, *(s for c in chosen for s in c.steps)]
        spent = self.around.cost(self.aim, held)
        found: list[_Offer] = []
        for course in self._offers(held):
            minutes = self.around.cost(self.aim, [*held, *course.steps])
            if minutes > self.around.budget:
                continue
            worth = self.aim.worth([*held, *course.steps], self.pace)
            if worth - now >= min(self.aim.least, 0.5 * (1.0 - now)):
                rate = (worth - now) / (minutes - spent + 1.0)  # a minute goes by for the follow-up itself
                found.append(_Offer(course, worth, minutes, rate))
        return found

    def _offers(self, held: Sequence[SequenceStep]) -> list[StepSequence]:
        """Every course that is worth a look."""
        here = held[-1].temperature if held else present(self.state, self.pace)
        picks = self._picked(held, here)
        offers = [StepSequence("poses", tuple(picks[:size])).times(r) for size in _SIZES for r in _REPEATS]
        for temperature in temperatures(here, self.reach):
            further = self._picked(held, temperature)
            offers += [StepSequence("soaks", tuple(further[:size])) for size in _SIZES]
        further = courses(self.state, self.reach, picks, here)
        offers += [c for c in further if (c.kind != "ramp" or self.rated) and (c.kind != "power" or self.timed)]
        return [c for c in offers if c.steps]

    def _picked(self, held: Sequence[SequenceStep], temperature: float) -> list[SequenceStep]:
        """The best poses at a temperature; none where the table or the chamber may not go there."""
        grid = pose_grid(self.reach, temperature)
        return self.aim.picks(held, grid, self.pace, _PICKS) if grid else []

    def _told(self, chosen: Sequence[StepSequence], worth: float) -> Proposal:
        steps = [s for c in chosen for s in c.steps]
        promise = self.aim.effect_of_steps(self.already, steps, self.pace)
        whole, free = [*self.already, *steps], self.already
        return Proposal(
            kinds=tuple(dict.fromkeys(c.kind for c in chosen)),
            steps=tuple(steps),
            ids=promise.ids,
            pair=promise.ids,
            minutes=self.around.cost(self.aim, whole) - self.around.cost(self.aim, free),
            before=promise.before,
            after=promise.after,
            settled=worth,
            if_true=promise.if_true,
            remaining=promise.remaining,
        )
