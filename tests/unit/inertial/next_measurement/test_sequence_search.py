"""The sequences of a proposal, judged lazily: the same answers as when every one is judged."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inertial.next_measurement.menus import Kind, StepSequence
from inertial.next_measurement.sequence_search import Offers
from inertial.planning.sequences import SequenceStep

NOW, BUDGET, LEAST = 0.2, 90.0, 0.03


KINDS: tuple[Kind, ...] = ("poses", "soaks", "ramp", "power")


@dataclass
class Told:
    """A search whose sequences have told minutes and shares; counts how many it is asked to judge."""

    minutes_of: list[float]
    shares: list[float]
    kinds: list[Kind]
    least: float = LEAST
    budget: float = BUDGET
    already: tuple[SequenceStep, ...] = ()
    judged: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        step = SequenceStep(0.0, 0.0, 25.0)
        self.all = [StepSequence(kind, (step,) * (k + 1)) for k, kind in enumerate(self.kinds)]

    def offers(self, held: Sequence[SequenceStep]) -> list[StepSequence]:
        return self.all

    def minutes(self, chosen: Sequence[StepSequence]) -> float:
        return sum(self.minutes_of[len(c.steps) - 1] for c in chosen)

    def share(self, chosen: Sequence[StepSequence]) -> float:
        place = len(chosen[-1].steps) - 1
        self.judged.append(place)
        return self.shares[place]


SEQUENCES = st.lists(
    st.tuples(st.floats(0.5, 120.0), st.floats(0.0, 1.0), st.sampled_from(KINDS)), min_size=1, max_size=30
)


def search_of(drawn: list[tuple[float, float, Kind]]) -> Told:
    minutes, shares, kinds = zip(*drawn, strict=True)
    return Told(list(minutes), list(shares), list(kinds))


@given(SEQUENCES)
def test_the_best_of_each_kind_are_those_of_judging_every_sequence(drawn: list[tuple[float, float, Kind]]) -> None:
    given_ = [(o.course.kind, o.rate) for o in Offers(search_of(drawn), [], NOW).by_kind()]
    best: dict[str, float] = {}
    for minutes, share, kind in drawn:
        if minutes <= BUDGET and share - NOW >= min(LEAST, 0.5 * (1.0 - NOW)):
            best[kind] = max(best.get(kind, 0.0), (share - NOW) / (minutes + 1.0))
    assert dict(given_) == pytest.approx(best)
    assert [rate for _, rate in given_] == sorted(best.values(), reverse=True)


@given(SEQUENCES, st.floats(1.0, 120.0))
def test_the_shortest_that_reaches_an_aim_is_that_of_judging_every_sequence(drawn, below):
    offer = Offers(search_of(drawn), [], NOW).shortest(0.6, below)
    reach = [minutes for minutes, share, _ in drawn if share >= 0.6 and minutes < below and minutes <= BUDGET]
    assert (None if offer is None else offer.minutes) == (min(reach) if reach else None)


def test_long_sequences_are_not_judged_where_a_short_one_brings_more_than_they_can() -> None:
    search = search_of([(5.0, 0.9, "poses"), *((m, 0.9, "soaks") for m in np.linspace(30.0, 80.0, 20))])
    assert next(Offers(search, [], NOW).by_kind()).minutes == 5.0
    assert search.judged == [0]
