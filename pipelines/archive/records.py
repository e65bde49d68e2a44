"""Captured records: one folder per record, published whole; what was captured is never measured again."""

from __future__ import annotations

from hashlib import sha256
from typing import TYPE_CHECKING

from pipelines.archive import files
from pipelines.archive.keys import digest
from pipelines.archive.store import ObjectPath

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    import pandas as pd

    from pipelines.archive.store import Place

PARTS = ("samples", "readings", "history")
COMPLETE = "complete.json"


class Records:
    """The records of one capture, as the sink that capture writes to and as the source that stages read from."""

    def __init__(self, path: Place) -> None:
        self.path = path
        self._newest = ""  # hash of the manifest that this object stored last

    def begin(self) -> None:
        """Clear away what a killed writer left; only the one process that captures may call this."""
        files.sweep(self.path)
        files.sweep(self.path / "state")

    def is_complete(self) -> bool:
        """Whether capture came to its end."""
        return (self.path / COMPLETE).is_file()

    def complete(self) -> None:
        """Note that capture came to its end."""
        content = {"records": len(self.finished()), "previous": self._head()}
        files.publish(self.path / COMPLETE, files.manifest_bytes(content))

    def finished(self) -> set[int]:
        """Numbers of the records that are stored whole."""
        return {int(folder.name) for folder in self._folders()}

    def put(
        self,
        record: int,
        samples: pd.DataFrame,
        readings: pd.DataFrame,
        history: pd.DataFrame,
        station_state: bytes,
    ) -> None:
        """Store one record, durably and all at once, with the station's state after it."""
        from schemas import tables

        content = {
            "samples.parquet": self._encoded("samples", samples),
            "readings.parquet": self._encoded("readings", readings),
            "history.parquet": self._encoded("history", history),
        }
        order = len(self.finished())
        state = self._state_path(record)
        files.publish(state, station_state)
        about = {"record": record, "order": order, "schema": tables.VERSION, "previous": self._head()}
        hashes = {name: sha256(data).hexdigest() for name, data in content.items()}
        manifest = files.manifest_bytes({**about, "content": hashes})
        files.publish_folder(self.path / f"{record:05d}", {**content, "record.json": manifest})
        self._newest = sha256(manifest).hexdigest()
        for old in state.parent.glob("*.bin"):
            if old != state:
                old.unlink()

    def last_state(self) -> bytes | None:
        """The station's state after the record stored last; None before the first."""
        last = self._last()
        if last is None:
            return None
        state = self._state_path(int(last.name))
        return state.read_bytes() if state.is_file() else None

    def hash(self) -> str:
        """Hash of everything captured, in order of record."""
        return digest({f.name: files.read_json(f / "record.json")["content"] for f in self._folders()})

    def samples(self, records: Collection[int] | None = None) -> Iterator[pd.DataFrame]:
        """The samples, one table per record in order of record: a lot's samples never lie in memory together.

        Parameters
        ----------
        records : numbers of those that are wanted; all where None
        """
        for folder in self._folders():
            if records is None or int(folder.name) in records:
                yield self._part(folder, "samples")

    def gathered(self, part: str) -> pd.DataFrame:
        """Readings, history or samples of all records in one table."""
        import pandas as pd

        parts = [self._part(folder, part) for folder in self._folders()]
        kept = [frame for frame in parts if len(frame)] or parts[:1]
        return pd.concat(kept, ignore_index=True)

    def _folders(self) -> list[Place]:
        """Folders of the records that are stored whole, in order of record."""
        if isinstance(self.path, ObjectPath):  # record.json is put last
            whole = [one.parent for one in self.path.walk() if one.name == "record.json"]
        else:
            whole = list(self.path.iterdir()) if self.path.is_dir() else []
        return sorted((folder for folder in whole if folder.name.isdigit()), key=lambda folder: folder.name)

    def _last(self) -> Place | None:
        """Folder of the record stored last; None before the first."""
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
    def _part(folder: Place, part: str) -> pd.DataFrame:
        name = f"{part}.parquet"
        return files.read_table(folder / name, part, files.read_json(folder / "record.json")["content"][name])

    @staticmethod
    def _encoded(name: str, frame: pd.DataFrame) -> bytes:
        from schemas import tables  # slow to import, and only writers of tables need it

        return files.table_bytes(name, tables.check(name, frame), tables.VERSION)
