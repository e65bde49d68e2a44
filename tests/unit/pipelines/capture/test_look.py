"""A capture that looks at its records: it ends where the look says so, and a resumed one asks nothing again."""

from dataclasses import replace

import pytest
from long_suites import mostly_slow
from small_station import MemorySink, lot_of, short_recipe

from pipelines.capture.capture import capture
from pipelines.capture.look import Look
from schemas.event import MemoryLog
from schemas.poses import SoakPart
from schemas.progress import silent
from schemas.recipe import Recipe
from schemas.station import load_station
from stations.opening import open_station

RECIPE = short_recipe(poses=5, static_s=3.0, temperatures=(23.0,)).model_copy(
    update={"soak_min_s": 1.0, "allow_short_soak": True}
)


class Told:
    """Looks that are given: after which record, and what they say."""

    def __init__(self, looks: dict[int, Look]) -> None:
        self.looks, self.asked = looks, list[int]()

    def due(self, record: int) -> bool:
        return record in self.looks

    def look(self, record: int, reported: frozenset[str]) -> Look:
        self.asked.append(record)
        own = self.looks[record]
        return replace(own, fails={unit: text for unit, text in own.fails.items() if unit not in reported})


def captured(sink: MemorySink, events: MemoryLog, looks: Told, recipe: Recipe = RECIPE) -> None:
    with open_station(load_station(), lot_of(2), resume=sink.last_state()) as station:
        capture(station, recipe, lot_of(2), sink, progress=silent, events=events, looks=looks)


def looks() -> Told:
    fails = {"U001": "zero_g_offset_mg 160 ± 2 mg, limit 150 mg"}
    first = Look(known=False, text="1 of 2 units decided", fails=fails, dwell_s=1.0)
    return Told({1: first, 2: Look(known=True, text="2 of 2 units decided", fails=fails, given_up=("third_order",))})


def test_a_lot_ends_when_it_is_known_and_says_so() -> None:
    sink, events = MemorySink(), MemoryLog()
    captured(sink, events, looks())
    kinds = [readings["kind"].iloc[0] for _, readings, _ in sink.records.values()]
    assert kinds == ["dwell"] * 3 + ["verification", "allan"]
    lengths = [float(readings["duration_s"].iloc[0]) for _, readings, _ in sink.records.values()]
    assert lengths == [2.0, 2.0, 1.0, 2.0, 3.0]
    told = [(one.kind, one.record, one.action) for one in events.events if one.kind not in ("soak", "reference")]
    assert told == [
        ("fails", 1, "unit U001 fails already, the others go on"),
        ("look", 1, "the lot goes on"),
        ("given_up", 2, "third_order"),
        ("known", 2, "2 records not taken"),
    ]


def test_dwells_on_a_ramp_keep_their_length() -> None:
    sink, ramp = MemorySink(), SoakPart(temperature_C=23.0, settled=False)
    captured(sink, MemoryLog(), looks(), RECIPE.model_copy(update={"soaks": [ramp], "static_record_s": 0.0}))
    lengths = {float(readings["duration_s"].iloc[0]) for _, readings, _ in sink.records.values()}
    assert lengths == {2.0}


@pytest.mark.parametrize("after", mostly_slow([2, 3], 3))
def test_a_resumed_capture_keeps_what_was_decided(after: int) -> None:
    whole, journal = MemorySink(), MemoryLog()
    captured(whole, journal, looks())
    sink, events = MemorySink(die_after=after), MemoryLog()
    with pytest.raises(KeyboardInterrupt):
        captured(sink, events, looks())
    sink.die_after = 10**6
    again = Told({1: Look(known=False, text="another"), 2: Look(known=after < 3, text="2 of 2 units decided")})
    before = [event for event in events.events if event.kind in ("look", "known")]
    captured(sink, events, again)
    assert set(sink.records) == set(whole.records)
    assert 1 not in again.asked
    assert (2 in again.asked) == (2 not in {event.record for event in before})
    assert all(sink.records[k][1]["duration_s"].equals(whole.records[k][1]["duration_s"]) for k in whole.records)
