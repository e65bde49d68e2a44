"""The choice of sequences for one aim, judged in the order of their largest possible gain per minute of station time."""

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

from inertial.estimation.alternative import Handling
from inertial.estimation.term import Term
from inertial.next_measurement.aims import Objective, Promise
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
from inertial.planning.reasons import drivers_of
from inertial.planning.sequences import SequenceStep, StationPace, standing, timeline
from inertial.state import State

_PICKS = 12
_SIZES = (3, 6, 12)
_REPEATS = (1, 2, 4)
_ROUNDS, _TRIED = 4, 4
_ALL = 0.999
"""Share of the aim that counts as complete."""

_KEPT = 0.5
"""Share of an offer's gain, computed on the grid, that must remain when every rival's parameters are fitted."""

Minutes = Callable[[Sequence[SequenceStep]], float]


@dataclass(frozen=True, kw_only=True)
class Proposal(Promise):
    """Steps to measure next, with their expected result.

    ids : the effects of the aim; pair : the two rivals that are separated most, empty for unseen effects
    minutes : station time; settled : share, 0 … 1, of the aim that is reached afterwards
    """

    kinds: tuple[Kind, ...]
    steps: tuple[SequenceStep, ...]
    pair: tuple[str, ...]
    minutes: float
    settled: float


@dataclass(frozen=True)
class Circumstances:
    """Limits of a proposal: the station's reach and pace, its time for steps (by default from the pace), the minutes to spend."""

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


@dataclass(frozen=True)
class Offer:
    """A sequence, the share of the aim reached after it, the total station time, and its gain per minute."""

    course: StepSequence
    worth: float
    minutes: float
    rate: float


class Offers:
    """The sequences that may follow chosen ones, judged only as far as their order requires.

    The share of the aim cannot exceed one, so that the station time bounds the gain per minute of a sequence. A sequence whose
    bound is below the best gain per minute is not judged, because that requires a fit of every rival to every other one.
    """

    def __init__(self, search: "ProposalSearch", chosen: Sequence[StepSequence], now: float) -> None:
        self.search, self.chosen, self.now = search, tuple(chosen), now
        self.spent = search.minutes(chosen)
        offered = search.offers([*search.already, *(s for c in chosen for s in c.steps)])
        minutes = [search.minutes([*chosen, c]) for c in offered]
        self.open = [(c, m) for c, m in zip(offered, minutes, strict=True) if m <= search.budget]
        self._judged: dict[int, Offer | None] = {}

    def _per_minute(self, gain: float, minutes: float) -> float:
        return gain / (minutes - self.spent + 1.0)  # one minute to start the follow-up measurement

    def _offer(self, index: int) -> Offer | None:
        """The judged sequence of an index; None if its gain is too small."""
        if index not in self._judged:
            course, minutes = self.open[index]
            worth = self.search.share([*self.chosen, course])
            gain, least = worth - self.now, min(self.search.least, 0.5 * (1.0 - self.now))
            offer = Offer(course, worth, minutes, self._per_minute(gain, minutes)) if gain >= least else None
            self._judged[index] = offer
        return self._judged[index]

    def by_kind(self) -> Iterator[Offer]:
        """The best of each kind by gain per minute, the best first."""
        bound = {k: self._per_minute(1.0 - self.now, minutes) for k, (_, minutes) in enumerate(self.open)}
        waiting = sorted(bound, key=lambda k: -bound[k])
        ready: list[tuple[float, int, Offer]] = []
        given: set[Kind] = set()
        while waiting or ready:
            if waiting and (not ready or bound[waiting[0]] >= -ready[0][0]):
                index = waiting.pop(0)
                if self.open[index][0].kind not in given and (offer := self._offer(index)) is not None:
                    heapq.heappush(ready, (-offer.rate, index, offer))
                continue
            offer = heapq.heappop(ready)[2]
            if offer.course.kind not in given:
                given.add(offer.course.kind)
                yield offer

    def shortest(self, worth: float, below: float) -> Offer | None:
        """The shortest sequence of less than ``below`` minutes that alone reaches the share ``worth``; None if none does."""
        for index in sorted(range(len(self.open)), key=lambda k: self.open[k][1]):
            if self.open[index][1] >= below:
                return None
            offer = self._offer(index)
            if offer is not None and offer.worth >= worth:
                return offer
        return None


def drivers_of_term(state: State, term: Term) -> frozenset[str]:
    """The drivers of an effect; none for a handling error."""
    return frozenset() if isinstance(term.effect, Handling) else frozenset(drivers_of(state, term.effect))


class ProposalSearch:
    """The choice of sequences for one aim."""

    def __init__(self, aim: Objective, around: Circumstances, already: Sequence[SequenceStep]) -> None:
        self.aim, self.around, self.already = aim, around, tuple(already)
        self.state = aim.lot.state
        self.reach = around.reach or reach_of(self.state)
        self.pace, self.budget, self.least = around.pace, around.budget, aim.least
        # dwells during a ramp disturb all effects of temperature: they are offered only for effects of its rate
        drivers_of_terms = [drivers_of_term(self.state, t) for t in aim.terms]
        self.rated = any("rate" in drivers for drivers in drivers_of_terms)
        self.timed = any("since_power" in drivers for drivers in drivers_of_terms)

    def best(self) -> Proposal | None:
        """The proposal of sequences chosen one after the other until the aim is reached or no further one helps; None if none.

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
            taken = self._confirmed(chosen, offers, now)
            if taken is None:
                break
            chosen, now = [*chosen, taken[0].course], taken[1]
        while chosen and now < _ALL and len(chosen) < 2 * _ROUNDS:
            # no further sequence helps on the grid: repeating the first one may still improve the separation
            promised = self.share([*chosen, chosen[0]], fine=True)
            within = self.minutes([*chosen, chosen[0]]) <= self.around.budget
            if not within or promised - now < min(self.aim.least, 0.5 * (1.0 - now)):
                break
            chosen, now = [*chosen, chosen[0]], promised
        sufficient = None
        if singles is not None:
            sufficient = singles.shortest(_ALL, below=self.minutes(chosen) if now >= _ALL else float("inf"))
        if sufficient is not None:
            promised = self.share([sufficient.course], fine=True)
            if promised >= min(now, _ALL):
                chosen, now = [sufficient.course], promised
        return self._proposal(chosen, now) if chosen else None

    def _confirmed(self, chosen: Sequence[StepSequence], offers: Offers, now: float) -> tuple[Offer, float] | None:
        """The best offer whose gain remains when every rival is fitted, and the share of the aim after it; None if none helps.

        On the grid alone wrong rivals seem more distant than they are. The best offer of each kind is therefore judged with every
        rival fitted, in order of gain per minute. If none keeps half of its gain, the offer with the largest gain is taken.
        """
        best: tuple[Offer, float] | None = None
        for offer in islice(offers.by_kind(), _TRIED):
            promised = self.share([*chosen, offer.course], fine=True)
            if promised - now >= _KEPT * (offer.worth - now):
                return offer, promised
            if best is None or promised > best[1]:
                best = offer, promised
        return best if best is not None and best[1] - now >= min(self.aim.least, 0.5 * (1.0 - now)) else None

    def share(self, chosen: Sequence[StepSequence], *, fine: bool = False) -> float:
        """Share of the aim after sequences, by the grid of the rivals' parameters; ``fine`` with every rival fitted."""
        return self.aim.worth([*self.already, *(s for c in chosen for s in c.steps)], self.pace, fine=fine)

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
        return Proposal(
            **vars(promise),
            kinds=tuple(dict.fromkeys(c.kind for c in chosen)),
            steps=tuple(steps),
            pair=promise.ids,
            minutes=self.minutes(chosen) - self.minutes([]),
            settled=worth,
        )
