"""The journal of a capture: one small file per event, beside its records."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from pipelines.archive.hash_chain import is_number
from pipelines.archive.store import Place
from schemas.event import Event

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "events"
SOAK_FIGURES = ("target_C", "seconds", "air_overshoot_K", "device_overshoot_K")


class Events:
    """The events of one capture, in the order in which they happened."""

    def __init__(self, capture: Place) -> None:
        self.path = capture / FOLDER

    def note(self, event: Event) -> None:
        """Write an event durably; an event that a resumed simulation repeats is written once."""
        known = self._files()
        if any(_event(content) == event for content in map(files.read_json, known)):
            return
        number = int(known[-1].stem) + 1 if known else 0
        content = {**event.document(), "when": datetime.now(UTC).isoformat(timespec="milliseconds")}
        files.publish(self.path / f"{number:05d}.json", files.json_bytes(content))

    def recorded(self) -> list[Event]:
        """Every event so far."""
        return [_event(content) for content in self.documents()]

    def documents(self) -> list[dict[str, Any]]:
        """The events for people and for JSON, with the date of each."""
        return [files.read_json(path) for path in self._files()]

    def table(self) -> pd.DataFrame:
        """Causes of pauses and of the end of the capture, with the action taken: the table ``events`` of the archive."""
        columns = {"time_s": float, "kind": "str", "record": "int64", "reason": "str", "action": "str"}
        return _table([{name: getattr(event, name) for name in columns} for event in self.recorded()], columns)

    def soaks(self) -> pd.DataFrame:
        """How long each soak took, and overshoot of air and devices: the table ``soaks`` of the archive."""
        soaks = [event for event in self.recorded() if event.kind == "soak" and event.figures]
        rows = [{"time_s": soak.time_s, "record": soak.record, **soak.figures} for soak in soaks]
        return _table(rows, {"time_s": float, "record": "int64", **dict.fromkeys(SOAK_FIGURES, float)})

    def hashes(self) -> dict[str, str]:
        """The hash of every event's file by its name."""
        return {path.name: files.sha256(path) for path in self._files()}

    def _files(self) -> list[Place]:
        if not self.path.is_dir():
            return []
        return sorted((path for path in self.path.glob("*.json") if is_number(path.stem)), key=lambda path: path.name)


def _table(rows: list[dict[str, Any]], columns: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(rows, columns=list(columns)).astype(columns)


def _event(content: dict[str, Any]) -> Event:
    return Event(**{name: content[name] for name in Event.__dataclass_fields__})
