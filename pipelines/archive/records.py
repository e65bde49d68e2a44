"""Captured records, and the journal of a capture beside them.

There is one folder per record, published whole: what was captured is never measured again. The journal has a file per event.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from pipelines.archive import files, parquet
from pipelines.archive.hash_chain import is_number
from pipelines.archive.keys import digest
from pipelines.archive.store import ObjectPath, Place
from schemas.errors import ArchiveUnusable
from schemas.event import Event

if TYPE_CHECKING:
    import pandas as pd

PARTS = ("samples", "readings", "history")
COMPLETE, EVENTS = "complete.json", "events"
SOAK_FIGURES = ("target_C", "seconds", "air_overshoot_K", "device_overshoot_K")


class Events:
    """The events of one capture, in the order in which they happened."""

    def __init__(self, capture: Place) -> None:
        self.path = capture / EVENTS

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
        """Duration of each soak, and overshoot of air and devices: the table ``soaks`` of the archive."""
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


class Records:
    """The records of one capture, as the sink that capture writes to and as the source that stages read from."""

    def __init__(self, path: Place) -> None:
        self.path = path
        self._newest = ""  # hash of the manifest that this object stored last
        self._ahead: dict[str, str] = {}  # hashes of the parts of a long record that are stored ahead of it

    @property
    def events(self) -> Events:
        """The capture's journal: what paused it, and why."""
        return Events(self.path)

    def begin(self) -> None:
        """Clear away what a killed writer left; only the one process that captures may call this."""
        for folder in (self.path, self.path / "state", self.path / EVENTS):
            files.sweep(folder)

    def is_complete(self) -> bool:
        """Whether capture came to its end."""
        return (self.path / COMPLETE).is_file()

    def complete(self) -> None:
        """Note that capture came to its end."""
        content = {"records": len(self.finished()), "previous": self._head(), "events": self.events.hashes()}
        files.publish(self.path / COMPLETE, files.manifest_bytes(content))

    def finished(self) -> set[int]:
        """Numbers of the records that are stored whole."""
        return {int(folder.name) for folder in self._folders()}

    def part(self, record: int, number: int, samples: pd.DataFrame) -> None:
        """Store a part of the samples of a record that is too long for the memory; part 0 begins anew.

        The parts are of no use without the record: one that was killed on its way is measured again, since noise has no gaps.
        """
        folder = files.ahead(self.path / f"{record:05d}")
        if number == 0:
            self._forget(record)
        name, data = f"samples-{number:05d}.parquet", self._encoded("samples", samples)
        files.publish(folder / name, data)
        self._ahead[name] = files.hash_of(data)

    def put(
        self,
        record: int,
        samples: pd.DataFrame,
        readings: pd.DataFrame,
        history: pd.DataFrame,
        station_state: bytes,
        parts: int = 0,
    ) -> None:
        """Store one record, durably and all at once, with the station's state after it.

        parts : how many parts of its samples are stored already; ``samples`` are the rest then
        """
        if parts:
            self.part(record, parts, samples)
        else:
            self._forget(record)
        from schemas import tables

        frames = {**({} if parts else {"samples": samples}), "readings": readings, "history": history}
        content = {f"{name}.parquet": self._encoded(name, frame) for name, frame in frames.items()}
        order = len(self.finished())
        state = self._state_path(record)
        files.publish(state, station_state)
        about = {"record": record, "order": order, "schema": tables.VERSION, "previous": self._head()}
        about["state"] = files.hash_of(station_state)
        hashes = {name: files.hash_of(data) for name, data in content.items()}
        manifest = files.manifest_bytes({**about, "content": {**self._ahead, **hashes}})
        files.publish_folder(self.path / f"{record:05d}", {**content, "record.json": manifest})
        self._newest, self._ahead = files.hash_of(manifest), {}
        for old in state.parent.glob("*.bin"):
            if old != state:
                old.unlink()

    def _forget(self, record: int) -> None:
        """Drops parts of an attempt at a record that was spoilt."""
        if self._ahead:
            files.drop(files.ahead(self.path / f"{record:05d}"))
            self._ahead = {}

    def last_state(self) -> bytes | None:
        """The station's state after the record stored last; None before the first."""
        last = self._last()
        if last is None:
            return None
        state = self._state_path(int(last.name))
        if not state.is_file():
            return None
        content = state.read_bytes()
        if files.read_json(last / "record.json").get("state", files.hash_of(content)) != files.hash_of(content):
            raise ArchiveUnusable(
                f"archive: {state} is not the station's state that record {last.name} was stored with; restore it from a copy, "
                "or measure the lot anew"
            )
        return content

    def hash(self) -> str:
        """Hash of everything captured, in order of record."""
        return digest({f.name: files.read_json(f / "record.json")["content"] for f in self._folders()})

    def samples(self, records: Collection[int] | None = None) -> Iterator[pd.DataFrame]:
        """The samples, one table per record in order of record, or several for a long record: they never lie in memory together.

        records : numbers of those that are wanted; all where None
        """
        for folder in self._folders():
            if records is None or int(folder.name) in records:
                yield from self._frames(folder, "samples")

    def gathered(self, part: str) -> pd.DataFrame:
        """Readings, history or samples of all records in one table."""
        import pandas as pd

        parts = [frame for folder in self._folders() for frame in self._frames(folder, part)]
        filled = [frame for frame in parts if len(frame)] or parts[:1]
        return pd.concat(filled, ignore_index=True)

    def _folders(self) -> list[Place]:
        """Folders of the records that are stored whole, in order of record."""
        if isinstance(self.path, ObjectPath):  # record.json is put last
            folders = [path.parent for path in self.path.walk() if path.name == "record.json"]
        else:
            folders = list(self.path.iterdir()) if self.path.is_dir() else []
        return sorted((folder for folder in folders if is_number(folder.name)), key=lambda folder: folder.name)

    def _last(self) -> Place | None:
        folders = self._folders()
        order = {folder: files.read_json(folder / "record.json")["order"] for folder in folders}
        return max(folders, key=lambda folder: order[folder]) if folders else None

    def _head(self) -> str:
        """Hash of the manifest of the record stored last: the next one names it; empty before the first."""
        if self._newest:
            return self._newest
        last = self._last()
        return files.sha256(last / "record.json") if last is not None else ""

    def _state_path(self, record: int) -> Place:
        return self.path / "state" / f"{record:05d}.bin"

    @staticmethod
    def _frames(folder: Place, part: str) -> Iterator[pd.DataFrame]:
        """The tables of one kind of a record, in order: one, or the parts of a long record's samples."""
        content = files.read_json(folder / "record.json")["content"]
        for name in sorted(content):
            if name == f"{part}.parquet" or name.startswith(f"{part}-"):
                yield parquet.read_table(folder / name, part, content[name])

    @staticmethod
    def _encoded(name: str, frame: pd.DataFrame) -> bytes:
        from schemas import table_check, tables  # slow to import, and only writers of tables need it

        return parquet.table_bytes(name, table_check.check(name, frame), tables.VERSION)
