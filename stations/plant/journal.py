"""The plant's journal: every write, line and fault since its start, with its time.

A replay on a new plant gives the same state, bit by bit.
"""

import hashlib
import json
import zlib
from array import array
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_args

from schemas.errors import ArchiveUnusable, DataRejected
from schemas.fault import FaultOrder
from schemas.lot import Lot
from schemas.profile import Space
from schemas.station import StationConfig

VERSION = 1
SPACES: tuple[Space, ...] = get_args(Space)
HEAD = 5  # numbers before the words of a write


@dataclass(frozen=True)
class Write:
    """Words, or bits, written to registers of a device, with the time of the plant."""

    at_us: int
    device_id: int
    address: int
    words: tuple[int, ...]
    space: Space = "holding"


@dataclass(frozen=True)
class LineOrder:
    """A text command to a device, with the time of the plant."""

    at_us: int
    device_id: int
    line: str


@dataclass(frozen=True)
class Injection:
    """A fault injected at a time of the plant."""

    at_us: int
    fault: FaultOrder


Event = Write | LineOrder | Injection


def fingerprint(config: StationConfig, lot: Lot) -> str:
    """Hash of station and lot: a state can be resumed only with the same hash."""
    text = config.model_dump_json(exclude={"suspenders", "safety", "self_test"}) + lot.model_dump_json()
    return hashlib.sha256(text.encode()).hexdigest()


class Journal:
    """Events in order. Writes are stored packed: those of a day need a few megabytes."""

    def __init__(self, belongs_to: str) -> None:
        self._belongs_to = belongs_to
        self._writes = array("q")  # time, device, space, address, count and words of each write, in sequence
        self._count = 0
        self._others: list[tuple[int, LineOrder | Injection]] = []  # with the number of writes before each
        # the first events as JSON, so that a state after every record costs no more each time
        self._texts: list[str] = []

    def add(self, event: Event) -> None:
        """Appends an event."""
        if not isinstance(event, Write):
            self._others.append((self._count, event))
            return
        address = event.device_id, SPACES.index(event.space), event.address
        self._writes.extend((event.at_us, *address, len(event.words), *event.words))
        self._count += 1

    def events(self, after: int = 0) -> Iterator[Event]:
        """Every event except the first ``after`` ones, in order."""
        others, at, skipped = deque(self._others), 0, 0
        for number in range(self._count + 1):
            while others and others[0][0] == number:
                other = others.popleft()[1]
                if skipped >= after:
                    yield other
                skipped += 1
            if number < self._count:
                words = self._writes[at + HEAD - 1]
                if skipped >= after:
                    time, device_id, space, address, _ = self._writes[at : at + HEAD]
                    content = self._writes[at + HEAD : at + HEAD + words]
                    yield Write(time, device_id, address, tuple(content), SPACES[space])
                at += HEAD + words
                skipped += 1

    def state(self, now_us: int) -> bytes:
        """The journal and the time as bytes."""
        self._texts += [_compact(_as_json(event)) for event in self.events(len(self._texts))]
        head = _compact({"version": VERSION, "belongs_to": self._belongs_to, "now_us": now_us})
        return zlib.compress(f'{head[:-1]},"events":[{",".join(self._texts)}]}}'.encode(), 6)

    def recorded(self, state: bytes) -> tuple[list[Event], int]:
        """The events in ``state`` and its time, µs; a state of another station or lot is refused.

        Raises ArchiveUnusable: the bytes are not a state
        Raises DataRejected: the state belongs to another station or lot
        """
        try:
            content: dict[str, Any] = json.loads(zlib.decompress(state))
        except (zlib.error, ValueError):
            raise ArchiveUnusable(
                "station state: not readable, the state of an earlier capture is needed; start the run again"
            ) from None
        if content.get("version") != VERSION or content.get("belongs_to") != self._belongs_to:
            raise DataRejected(
                "station state: it belongs to another station or lot; resume with the same files and the same units"
            )
        return [_from_json(item) for item in content["events"]], int(content["now_us"])


def _compact(content: object) -> str:
    return json.dumps(content, separators=(",", ":"))


def _as_json(event: Event) -> dict[str, object]:
    if isinstance(event, Injection):
        return {"at_us": event.at_us, "fault": event.fault.model_dump()}
    if isinstance(event, LineOrder):
        return {"at_us": event.at_us, "device_id": event.device_id, "line": event.line}
    space = {} if event.space == "holding" else {"space": event.space}
    address = {"at_us": event.at_us, "device_id": event.device_id, "address": event.address}
    return {**address, "words": list(event.words), **space}


def _from_json(item: dict[str, Any]) -> Event:
    at_us = int(item["at_us"])
    if "fault" in item:
        return Injection(at_us, FaultOrder.model_validate(item["fault"]))
    if "line" in item:
        return LineOrder(at_us, item["device_id"], item["line"])
    return Write(at_us, item["device_id"], item["address"], tuple(item["words"]), item.get("space", "holding"))
