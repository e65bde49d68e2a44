"""The plant's journal: everything that was ever done to it, with the time.

Played again on a fresh plant, it leads to the same place, bit for bit.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from schemas.errors import ArchiveUnusable, DataRejected
from schemas.fault import Fault

if TYPE_CHECKING:
    from schemas.recipe import Lot
    from schemas.station import StationConfig
    from stations.plant.plant import Plant

VERSION = 1


@dataclass(frozen=True)
class Write:
    """Words written to a device's registers at a time of the plant."""

    at_us: int
    device_id: int
    address: int
    words: tuple[int, ...]


@dataclass(frozen=True)
class Injection:
    """A fault arranged at a time of the plant."""

    at_us: int
    fault: Fault


Event = Write | Injection


def fingerprint(config: StationConfig, lot: Lot) -> str:
    """What a state may be put back into: the same station with the same lot."""
    text = config.model_dump_json(exclude={"suspenders", "safety", "self_test"}) + lot.model_dump_json()
    return hashlib.sha256(text.encode()).hexdigest()


class Journal:
    """Events in order."""

    def __init__(self, belongs_to: str) -> None:
        self._belongs_to = belongs_to
        self._events: list[Event] = []

    def add(self, event: Event) -> None:
        """Notes an event that has happened."""
        self._events.append(event)

    def state(self, now_us: int) -> bytes:
        """The journal and the time as bytes."""
        content = {
            "version": VERSION,
            "belongs_to": self._belongs_to,
            "now_us": now_us,
            "events": [_as_json(event) for event in self._events],
        }
        return zlib.compress(json.dumps(content, separators=(",", ":")).encode(), 6)

    def replay(self, state: bytes, plant: Plant) -> None:
        """Takes a fresh plant through the events in ``state``, to its time; a state of another station or lot is refused."""
        try:
            content: dict[str, Any] = json.loads(zlib.decompress(state))
        except (zlib.error, ValueError):
            message = "station state: not readable, bytes of an earlier capture are needed; start the run afresh"
            raise ArchiveUnusable(message) from None
        if content.get("version") != VERSION or content.get("belongs_to") != self._belongs_to:
            message = "station state: it was taken from another station or lot; resume with the same files and units"
            raise DataRejected(message)
        for item in content["events"]:
            plant.advance(int(item["at_us"]) - plant.now_us)
            if "fault" in item:
                plant.inject(Fault.model_validate(item["fault"]))
            else:
                plant.write(item["device_id"], item["address"], list(item["words"]))
        plant.advance(int(content["now_us"]) - plant.now_us)


def _as_json(event: Event) -> dict[str, object]:
    if isinstance(event, Injection):
        return {"at_us": event.at_us, "fault": event.fault.model_dump()}
    return {
        "at_us": event.at_us,
        "device_id": event.device_id,
        "address": event.address,
        "words": list(event.words),
    }
