"""The state of a plant's journal: the same bytes whether it was asked for after every event or once."""

import json
import zlib

from schemas.fault import FaultOrder
from stations.plant.journal import Injection, Journal, LineOrder, Write

EVENTS = [
    Write(1, 2, 100, (1, 2, 3)),
    Injection(2, FaultOrder(kind="door", at_s=1.0)),
    LineOrder(3, 5, "SETP 25"),
    Write(4, 2, 101, (), "coil"),
    Write(5, 3, 7, (9,)),
    Injection(6, FaultOrder(kind="noise", serial="U001")),
]


def test_a_state_after_every_event_is_that_of_all_events_at_once() -> None:
    often, once = Journal("station"), Journal("station")
    for number, event in enumerate(EVENTS, start=1):
        often.add(event)
        assert [e for e, _ in zip(often.events(), EVENTS, strict=False)] == EVENTS[:number]
        assert len(json.loads(zlib.decompress(often.state(number)))["events"]) == number
        once.add(event)
    assert often.state(9) == once.state(9)
    assert once.recorded(often.state(9)) == (EVENTS, 9)


def test_a_state_is_compact_json() -> None:
    journal = Journal("station")
    text = zlib.decompress(journal.state(3)).decode()
    assert text == json.dumps({"version": 1, "belongs_to": "station", "now_us": 3, "events": []}, separators=(",", ":"))
    journal.add(EVENTS[0])
    assert json.loads(zlib.decompress(journal.state(3)))["events"] == [
        {"at_us": 1, "device_id": 2, "address": 100, "words": [1, 2, 3]}
    ]
