"""The sequences that may follow chosen ones in a proposal, judged in the order of what they can bring per minute."""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from inertial.next_measurement.menus import Kind, StepSequence
from inertial.planning.sequences import SequenceStep


class SequenceSearch(Protocol):
    """What is asked of the search that the sequences are for."""

    least: float
    budget: float
    already: tuple[SequenceStep, ...]

    def offers(self, held: Sequence[SequenceStep]) -> list[StepSequence]:
        """All sequences that may follow steps."""
        ...

    def minutes(self, chosen: Sequence[StepSequence]) -> float:
        """Station time of sequences after the steps planned already."""
        ...

    def share(self, chosen: Sequence[StepSequence]) -> float:
        """Share, 0 … 1, of the aim after sequences, by the grid of the rivals' parameters."""
        ...


@dataclass(frozen=True)
class Offer:
    """A sequence with the share of the aim after it, the station time until then, and its gain per minute."""

    course: StepSequence
    worth: float
    minutes: float
    rate: float


class Offers:
    """The sequences that may follow chosen ones, judged only as far as their order needs it.

    The share of the aim cannot exceed one, so station time alone bounds the gain per minute of a sequence, and the judgement of a
    sequence, which fits every rival to every other, is left out where its bound is below the best gain per minute.
    """

    def __init__(self, search: SequenceSearch, chosen: Sequence[StepSequence], now: float) -> None:
        self.search, self.chosen, self.now = search, tuple(chosen), now
        self.spent = search.minutes(chosen)
        offered = search.offers([*search.already, *(s for c in chosen for s in c.steps)])
        minutes = [search.minutes([*chosen, c]) for c in offered]
        self.open = [(c, m) for c, m in zip(offered, minutes, strict=True) if m <= search.budget]
        self._judged: dict[int, Offer | None] = {}

    def _per_minute(self, gain: float, minutes: float) -> float:
        return gain / (minutes - self.spent + 1.0)  # a minute for the start of the follow-up

    def _offer(self, place: int) -> Offer | None:
        """The sequence with what it brings; None if that is too little."""
        if place not in self._judged:
            course, minutes = self.open[place]
            worth = self.search.share([*self.chosen, course])
            gain, least = worth - self.now, min(self.search.least, 0.5 * (1.0 - self.now))
            offer = Offer(course, worth, minutes, self._per_minute(gain, minutes)) if gain >= least else None
            self._judged[place] = offer
        return self._judged[place]

    def by_kind(self) -> Iterator[Offer]:
        """The best of each kind by gain per minute, the best first."""
        bound = {k: self._per_minute(1.0 - self.now, minutes) for k, (_, minutes) in enumerate(self.open)}
        waiting = sorted(bound, key=lambda k: -bound[k])
        ready: list[tuple[float, int, Offer]] = []
        given: set[Kind] = set()
        while waiting or ready:
            if waiting and (not ready or bound[waiting[0]] >= -ready[0][0]):
                place = waiting.pop(0)
                if self.open[place][0].kind not in given and (offer := self._offer(place)) is not None:
                    heapq.heappush(ready, (-offer.rate, place, offer))
                continue
            offer = heapq.heappop(ready)[2]
            if offer.course.kind not in given:
                given.add(offer.course.kind)
                yield offer

    def shortest(self, worth: float, below: float) -> Offer | None:
        """The shortest of the sequences that alone reach a share of the aim in less than some minutes; None without one."""
        for place in sorted(range(len(self.open)), key=lambda k: self.open[k][1]):
            if self.open[place][1] >= below:
                return None
            offer = self._offer(place)
            if offer is not None and offer.worth >= worth:
                return offer
        return None
