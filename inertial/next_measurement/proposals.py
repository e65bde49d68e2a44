"""The next measurement: steps that separate rivals of equal fit, or show unseen effects, by gain per minute of station time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from inertial import effects as catalogue
from inertial.criticism.classes import EffectClass
from inertial.design import grid_of
from inertial.errors import MissingInput
from inertial.estimation.alternative import Handling
from inertial.estimation.model import Model
from inertial.estimation.term import Term
from inertial.next_measurement.aims import Objective, RivalDiscrimination, Sighting
from inertial.next_measurement.menus import (
    Kind,
    StepSequence,
    TableReach,
    courses,
    pose_grid,
    present,
    reach_of,
    temperatures,
)
from inertial.next_measurement.offers import Offer, Offers
from inertial.next_measurement.separation import FEW, MANY, Rivals, rivals_of
from inertial.next_measurement.twins import never_apart, twins_of
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
"""Share of the aim that counts as complete."""

_KEPT = 0.5
"""Share of an offer's gain on the grid that must remain when every rival is fitted."""

Minutes = Callable[[Sequence[SequenceStep]], float]


@dataclass(frozen=True)
class Proposal:
    """Steps to measure next.

    ids : the effects of the aim; pair : the two rivals that it separates most; empty for unseen effects
    minutes : of station time
    before, after : chi-square between the two rivals so far, and expected with the steps, the smaller for either being true; of a
    coefficient of typical size for unseen effects
    if_true : expected with the steps, by true rival; remaining : rivals that are not separated from the best
    settled : share of the aim that is reached afterwards, 0 … 1
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
    """Limits of a proposal: the station's reach and pace, its time for steps, and the minutes that may be spent."""

    reach: TableReach | None = None
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
    """The members of a class as rivals; None for a class of one, and without known angles."""
    if len(group.members) < 2 or not _goes_on(model):
        return None
    others = [t for t in model.terms if t.effect.id not in group.ids]
    return rivals_of(model, [m.term for m in group.members[:_MEMBERS]], others, most)


def proposal(
    model: Model, group: EffectClass, around: Circumstances | None = None, already: Sequence[SequenceStep] = ()
) -> Proposal | None:
    """The steps that best separate the members of a class; None if no steps of the station are certain to separate two of them.

    Parameters
    ----------
    already : steps already planned for another class; the proposal follows them
    """
    rivals, every = rivals_in(model, group), rivals_in(model, group, MANY)
    if rivals is None or every is None:
        return None
    around = around or Circumstances()
    never = never_apart(rivals, around.reach, around.pace)
    if never[0, 1:].all():
        return None
    scores = np.array([m.score for m in group.members[:_MEMBERS]])
    proposed = ProposalSearch(RivalDiscrimination(rivals, scores, every, never), around, already).best()
    # a measurement that may separate nothing is not worth its station time
    return (
        None
        if proposed is None or len(proposed.remaining) == len(rivals.terms) - 1
        else replace(proposed, ids=rivals.ids)
    )


def twins(model: Model, group: EffectClass, around: Circumstances | None = None) -> tuple[str, ...]:
    """The best member of a class and those that no measurement of the station separates from it; empty if there are none."""
    rivals = rivals_in(model, group)
    around = around or Circumstances()
    return () if rivals is None else twins_of(rivals, never_apart(rivals, around.reach, around.pace))


def sighting(
    model: Model, unseen: Sequence[str], around: Circumstances | None = None, already: Sequence[SequenceStep] = ()
) -> Proposal | None:
    """The steps that best show unseen effects; None if none matters, or the station can show none.

    An effect matters if its usual
    size exceeds the noise.
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
    proposed = ProposalSearch(Sighting(rivals, terms), around, already).best()
    return None if proposed is None else replace(proposed, pair=())


def _goes_on(model: Model) -> bool:
    """Whether the angles of the table are known."""
    state = model.problem.lot.state
    return state.outer is not None and state.inner is not None and not model.problem.lot.radial


def _term(model: Model, name: str) -> Term | None:
    """An effect at the middle of its grid; None if the dwells lack a quantity."""
    effect, state = catalogue.get(name), model.problem.lot.state
    try:
        grid = grid_of(effect, state)
        model.problem.columns(effect, grid[0])
    except MissingInput:
        return None
    return Term(effect, tuple(grid[len(grid) // 2].items()))


def _drivers(state: State, term: Term) -> frozenset[str]:
    """The drivers of an effect; none for a handling error."""
    return frozenset() if isinstance(term.effect, Handling) else frozenset(drivers_of(state, term.effect))


class ProposalSearch:
    """The choice of sequences for one aim."""

    def __init__(self, aim: Objective, around: Circumstances, already: Sequence[SequenceStep]) -> None:
        self.aim, self.around, self.already = aim, around, tuple(already)
        self.state = aim.lot.state
        self.reach = around.reach or reach_of(self.state)
        self.pace, self.budget, self.least = around.pace, around.budget, aim.least
        # dwells during a ramp disturb every effect of temperature: only for effects that respond to its rate
        answers = [_drivers(self.state, t) for t in aim.terms]
        self.rated = any("rate" in drivers for drivers in answers)
        self.timed = any("since_power" in drivers for drivers in answers)

    def best(self) -> Proposal | None:
        """Sequences in order, each the best after those before it, until the aim is reached or nothing more helps.

        A single sequence that reaches the aim replaces them if they take more time, or do not reach it.
        """
        chosen: list[StepSequence] = []
        now = self.aim.worth(self.already, self.pace)
        singles: Offers | None = None
        for _ in range(_ROUNDS):
            if now >= _ALL:
                break
            offers = Offers(self, chosen, now)
            singles = singles or offers
            taken = self._kept(chosen, offers, now)
            if taken is None:
                break
            chosen, now = [*chosen, taken[0].course], taken[1]
        while chosen and now < _ALL and len(chosen) < 2 * _ROUNDS:
            # the grid shows no difference any more: what parts them once parts them better twice
            promised = self._promised([*chosen, chosen[0]])
            within = self.minutes([*chosen, chosen[0]]) <= self.around.budget
            if not within or promised - now < min(self.aim.least, 0.5 * (1.0 - now)):
                break
            chosen, now = [*chosen, chosen[0]], promised
        whole = None
        if singles is not None:
            whole = singles.shortest(_ALL, below=self.minutes(chosen) if now >= _ALL else float("inf"))
        if whole is not None:
            promised = self._promised([whole.course])
            if promised >= min(now, _ALL):
                chosen, now = [whole.course], promised
        return self._proposal(chosen, now) if chosen else None

    def _kept(self, chosen: Sequence[StepSequence], offers: Offers, now: float) -> tuple[Offer, float] | None:
        """The offer with the largest gain per minute whose gain remains when every rival is fitted, and the share after it.

        On the grid alone the wrong rivals seem more distant than they are: an offer is judged with every rival fitted, the best
        of each kind in turn. Where none keeps half of its gain, the offer with the largest gain is taken.
        """
        best: tuple[Offer, float] | None = None
        for offer in islice(offers.by_kind(), _TRIED):
            promised = self._promised([*chosen, offer.course])
            if promised - now >= _KEPT * (offer.worth - now):
                return offer, promised
            if best is None or promised > best[1]:
                best = offer, promised
        return best if best is not None and best[1] - now >= min(self.aim.least, 0.5 * (1.0 - now)) else None

    def share(self, chosen: Sequence[StepSequence], *, fine: bool = False) -> float:
        """Share of the aim after sequences, by the grid of the rivals' parameters; ``fine`` with every rival fitted."""
        return self.aim.worth([*self.already, *(s for c in chosen for s in c.steps)], self.pace, fine=fine)

    def _promised(self, chosen: Sequence[StepSequence]) -> float:
        """Share of the aim after sequences, with every rival fitted as in the diagnosis."""
        return self.share(chosen, fine=True)

    def minutes(self, chosen: Sequence[StepSequence]) -> float:
        """Station time of sequences after those planned already."""
        return self.around.cost(self.aim, [*self.already, *(s for c in chosen for s in c.steps)])

    def offers(self, held: Sequence[SequenceStep]) -> list[StepSequence]:
        """All candidate sequences."""
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
        """The best poses at a temperature; none if the table or the chamber must not go there."""
        grid = pose_grid(self.reach, temperature)
        return self.aim.picks(held, grid, self.pace, _PICKS) if grid else []

    def _proposal(self, chosen: Sequence[StepSequence], worth: float) -> Proposal:
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
