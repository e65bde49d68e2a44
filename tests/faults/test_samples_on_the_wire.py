"""Samples on their way: lost answers, changed bytes, counters that contradict each other."""

import pytest
from each import each
from long_suites import mostly_slow
from small_station import MemorySink, lot_of, quiet_progress, short_recipe

from pipelines.capture.capture import capture
from schemas.errors import StationRefused
from schemas.event import MemoryLog
from schemas.fault import FaultOrder
from schemas.station import load_station
from stations.opening import make_plant, serve_plant
from stations.plant.faults import proxy, wire
from stations.plant.faults.proxy import HEADER, WireAction

WRITE, READ = 16, 3
SLOT_1 = 12


def captured(monkeypatch: pytest.MonkeyPatch, script) -> tuple[MemorySink, MemoryLog]:
    if script is None:
        monkeypatch.undo()
    else:
        monkeypatch.setattr(wire, "script_of", lambda _world, _faults: script)
    config, lot = load_station(), lot_of()
    config = config.model_copy(update={"link": config.link.model_copy(update={"timeout_s": 0.6})})
    sink, events = MemorySink(), MemoryLog()
    with serve_plant(config, lot, make_plant(config, lot)) as station:
        capture(station, short_recipe(), lot, sink, progress=quiet_progress, events=events)
    return sink, events


@pytest.mark.slow
def test_a_slot_whose_answer_to_what_was_taken_is_lost_is_asked_and_keeps_its_unit(monkeypatch) -> None:
    lost: list[bytes] = []

    def script(way, frame):
        if way == "reply" and frame[HEADER - 1] == SLOT_1 and frame[HEADER] == WRITE and len(lost) < 3:
            lost.append(frame)
            return WireAction("drop")
        return None

    sink, _ = captured(monkeypatch, script)
    assert len(lost) == 3
    assert (sink.all(1)["status"] == "ok").all()
    assert (sink.all(1)["n"] == 200).all()
    undisturbed, _ = captured(monkeypatch, None)
    assert sink.all(0).equals(undisturbed.all(0)), "nothing is taken twice, nothing is missing"


CHANGED = [(9, 0x40), (9 + 8 * 3 + 2, 0x04), (9 + 8 * 10 + 5, 0x40), (9 + 8 * 5 + 7, 0x01)]


@pytest.mark.parametrize(("byte", "bit"), mostly_slow(CHANGED, CHANGED[0], CHANGED[-1]))
def test_samples_that_change_on_their_way_are_measured_again(monkeypatch, byte: int, bit: int) -> None:
    changed: list[bytes] = []

    def script(way, frame):
        samples = way == "reply" and frame[HEADER - 1] == SLOT_1 and frame[HEADER] == READ and len(frame) > 240
        return WireAction("duplicate") if samples and not changed else None

    def spoilt(frame, _action, _of):
        """One bit of the frame is another, in place of its duplicate."""
        changed.append(frame)
        other = bytearray(frame)
        other[byte] ^= bit
        return [bytes(other)]

    monkeypatch.setattr(proxy, "replaced", spoilt)
    sink, events = captured(monkeypatch, script)
    assert changed
    [reason] = [event.reason for event in events.recorded() if event.kind == "spoilt"]
    assert "slot 1: sample" in reason
    assert (sink.all(1)["status"] == "ok").all()


@each(
    [
        (FaultOrder(kind="swapped_words", serial="U000"), lambda reader: reader.slots[0].identity(), "word order"),
        (FaultOrder(kind="exceptions_off", device="reader"), lambda reader: reader.start(100.0), "sampling is stopped"),
    ],
    lambda row: row[2],
)
def test_words_in_the_wrong_order_are_no_identity_and_a_reader_that_does_not_start_is_refused(row) -> None:
    fault, asked, words = row
    config, lot = load_station(), lot_of(1)
    plant = make_plant(config, lot)
    plant.inject(fault)
    with serve_plant(config, lot, plant) as station, pytest.raises(StationRefused, match=words):
        asked(station.reader)


def test_a_slot_that_forgets_what_was_taken_is_refused() -> None:
    config, lot = load_station(), lot_of(1)
    plant = make_plant(config, lot)
    with serve_plant(config, lot, plant) as station:
        slot = station.reader.slots[0]
        station.reader.start(100.0)
        station.clock.sleep(1.0)
        assert len(slot.take().outputs) == 100
        plant.sampler.tail[0] = 50
        station.clock.sleep(1.0)
        with pytest.raises(StationRefused, match="reports 50 of 200 samples as read, 100 is needed"):
            slot.take()
