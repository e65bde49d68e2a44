"""The plant's journal: everything that was ever done to it, with the time.

Played again on a fresh plant, it leads to the same place, bit for bit.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from array import array
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

from schemas.errors import ArchiveUnusable, DataRejected
from schemas.fault import FaultOrder
from schemas.profile import Space

if TYPE_CHECKING:
    from schemas.recipe import Lot
    from schemas.station import StationConfig
    from stations.plant.plant import Plant

VERSION = 1
SPACES: tuple[Space, ...] = get_args(Space)
HEAD = 5  # numbers before the words of a write


@dataclass(frozen=True)
class Write:
    """Words, or bits, written to a device's registers at a time of the plant."""

    at_us: int
    device_id: int
    address: int
    words: tuple[int, ...]
    space: Space = "holding"


@dataclass(frozen=True)
class Said:
    """An order given to a device in a line of text, at a time of the plant."""

    at_us: int
    device_id: int
    line: str


@dataclass(frozen=True)
class Injection:
    """A fault arranged at a time of the plant."""

    at_us: int
    fault: FaultOrder


Event = Write | Said | Injection


def fingerprint(config: StationConfig, lot: Lot) -> str:
    """What a state may be put back into: the same station with the same lot."""
    text = config.model_dump_json(exclude={"suspenders", "safety", "self_test"}) + lot.model_dump_json()
    return hashlib.sha256(text.encode()).hexdigest()


class Journal:
    """Events in order. Writes are kept packed: a day of them takes a few megabytes."""

    def __init__(self, belongs_to: str) -> None:
        self._belongs_to = belongs_to
        self._writes = array("q")  # time, device, space, address, count, words; one after the other
        self._count = 0
        self._others: list[tuple[int, Said | Injection]] = []  # with the number of writes before each

    def add(self, event: Event) -> None:
        """Notes an event that has happened."""
        if not isinstance(event, Write):
            self._others.append((self._count, event))
            return
        place = event.device_id, SPACES.index(event.space), event.address
        self._writes.extend((event.at_us, *place, len(event.words), *event.words))
        self._count += 1

    def events(self) -> Iterator[Event]:
        """Every event, in order."""
        waiting, at = deque(self._others), 0
        for number in range(self._count + 1):
            while waiting and waiting[0][0] == number:
                yield waiting.popleft()[1]
            if number < self._count:
                time, device_id, space, address, words = self._writes[at : at + HEAD]
                at += HEAD + words
                yield Write(time, device_id, address, tuple(self._writes[at - words : at]), SPACES[space])

    def state(self, now_us: int) -> bytes:
        """The journal and the time as bytes."""
        content = {
            "version": VERSION,
            "belongs_to": self._belongs_to,
            "now_us": now_us,
            "events": [_as_json(event) for event in self.events()],
        }
        return zlib.compress(json.dumps(content, separators=(",", ":")).encode(), 6)

    def replay(self, state: bytes, plant: Plant) -> None:
        """Takes a fresh plant through the events in ``state``, to its time; a state of another station or lot is refused."""
        try:
            content: dict[str, Any] = json.loads(zlib.decompress(state))
        except (zlib.error, ValueError):
            raise ArchiveUnusable(
                "station state: not readable, bytes of an earlier capture are needed; start the run afresh"
            ) from None
        if content.get("version") != VERSION or content.get("belongs_to") != self._belongs_to:
            raise DataRejected(
                "station state: it was taken from another station or lot; resume with the same files and units"
            )
        for item in content["events"]:
            plant.advance(int(item["at_us"]) - plant.now_us)
            if "fault" in item:
                plant.inject(FaultOrder.model_validate(item["fault"]))
            elif "line" in item:
                plant.say(item["device_id"], item["line"])
            else:
                plant.write(item["device_id"], item["address"], list(item["words"]), item.get("space", "holding"))
        plant.advance(int(content["now_us"]) - plant.now_us)


def _as_json(event: Event) -> dict[str, object]:
    if isinstance(event, Injection):
        return {"at_us": event.at_us, "fault": event.fault.model_dump()}
    if isinstance(event, Said):
        return {"at_us": event.at_us, "device_id": event.device_id, "line": event.line}
    found: dict[str, object] = {"at_us": event.at_us, "device_id": event.device_id, "address": event.address}
    found["words"] = list(event.words)
    if event.space != "holding":
        found["space"] = event.space
    return found
