"""A run whose tables are read once and written together, because the stages of a re-run share tables and make many."""

import json
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import pandas as pd
import pyarrow as pa

from pipelines.archive import files
from pipelines.archive.archive import Archive
from pipelines.archive.parquet import decoded
from pipelines.archive.run import START, Run


class BufferedRun(Run):
    """A run that keeps its tables in memory as they are in its files, and its new files until they are written."""

    def __init__(self, archive: Archive, run_id: str) -> None:
        super().__init__(archive, run_id)
        self._known: dict[str, pd.DataFrame] = {}
        self._waiting: dict[str, bytes] = {}
        self._made: dict[str, pa.Table] = {}

    def begin(self, about: dict[str, Any]) -> None:
        """Set the start of a new run; it is written with the tables."""
        data = files.manifest_bytes(about)
        self._put(START, data)
        self.__dict__["about"] = files.parsed(data, self.path / START)

    @cached_property
    def about(self) -> dict[str, Any]:  # pyright: ignore[reportIncompatibleMethodOverride]  # it does not change
        """The content of ``run.json``."""
        return files.read_json(self.path / "run.json")

    def table(self, name: str, columns: Sequence[str] = ()) -> pd.DataFrame:
        """A table of the run; the caller may change it. Only whole tables are kept.

        A new table also passes through its encoded columns: the memory layout of a stage's table may differ from that of a table
        from a file, and sums over it would differ in their last digits.
        """
        if name not in self._known:
            made = self._made.pop(name, None) or self._adopted(name)
            if columns and made is None:
                return super().table(name, columns)
            self._known[name] = super().table(name) if made is None else made.to_pandas(use_threads=False)
        return self._known[name].copy(deep=False)

    def manifest(self, name: str) -> dict[str, Any]:
        """The manifest of a table, written or not."""
        waiting = self._waiting.get(f"{name}.json")
        return super().manifest(name) if waiting is None else json.loads(waiting)

    def flush(self, *, last: str = "") -> None:
        """Publish all waiting files, tables and manifests in the order in which they were made.

        last : a file that is published after all others; it shows readers that the others exist.
        """
        if self._waiting:
            if last in self._waiting:
                self._waiting[last] = self._waiting.pop(last)
            files.publish_all(self.path, self._waiting)
            self._waiting = {}

    def forget(self) -> None:
        """Discard all waiting files."""
        self._waiting = {}

    def _adopted(self, name: str) -> pa.Table | None:
        """A reused table that is not written yet."""
        waiting = self._waiting.get(f"{name}.parquet")
        return None if waiting is None else decoded(waiting)

    def _put_table(self, name: str, table: pa.Table) -> bytes:
        self._made[name] = table
        return super()._put_table(name, table)

    def _put(self, name: str, data: bytes) -> None:
        self._waiting[name] = data

    def _hash_of(self, name: str) -> str:
        waiting = self._waiting.get(name)
        return super()._hash_of(name) if waiting is None else files.hash_of(waiting)
