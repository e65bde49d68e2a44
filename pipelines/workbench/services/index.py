"""The index of the archive for the pages: renewed when a run was added, else every few seconds.

To check every file of ten thousand runs takes more than half a second, too long for each click on a page.
"""

import threading
import time
from pathlib import Path

from pipelines.archive import Archive
from pipelines.archive.store import Place
from pipelines.audit.index import AuditIndex, up_to_date
from pipelines.audit.tables_in_memory import QueryResult, TablesInMemory, in_memory, unit_in_memory

SEARCHED = frozenset({"runs", "units"})
"""Tables that every search reads: kept in memory, some 20 MB for 100 000 calibrations."""
FRESH_S = 4.0
"""Age, s, up to which an index is used unchanged; a finished stage of a known run is shown a second later at the latest."""
PAUSE_S = 1.0
USABLE_S = 60.0
"""Age, s, up to which a page is answered from the index while it is renewed in the background."""


class RecentIndex:
    """The index of one archive, shared by the handlers.

    Parameters
    ----------
    address : of the archive
    """

    def __init__(self, address: str) -> None:
        self._archive = Archive(address)
        self._lock = threading.RLock()
        self._known: AuditIndex | None = None
        self._when, self._folder = 0.0, 0
        self._renewing = threading.Event()
        self._reading = threading.Lock()
        self._tables: TablesInMemory | None = None
        self._parts: tuple[Place, ...] = ()

    def ask(self, sql: str) -> QueryResult:
        """The answer to a query over :data:`SEARCHED`."""
        return self._in_memory(self.index()).ask(sql)

    def of_unit(self, unit: str, sql: str) -> QueryResult:
        """The answer to a query over the coefficients of one unit and its runs."""
        return unit_in_memory(self.index(), unit).ask(sql)

    def _in_memory(self, index: AuditIndex) -> TablesInMemory:
        """The searched tables of an index; the name of a part changes with its content."""
        with self._reading:
            if self._tables is None or self._parts != index.parts:
                self._tables, self._parts = in_memory(index, SEARCHED), index.parts
            return self._tables

    def index(self) -> AuditIndex:
        """The index with every run that was added up to now."""
        with self._lock:
            age, folder = time.monotonic() - self._when, self._stamp()
            if self._known is None or folder != self._folder or age > USABLE_S:
                return self._renew()
            if age > FRESH_S and not self._renewing.is_set():
                self._renewing.set()
                later = threading.Timer(PAUSE_S, self._renew_behind)  # after this answer, not beside it
                later.daemon = True
                later.start()
            return self._known

    def _renew(self) -> AuditIndex:
        """The index made new; stored unless a newer index was made in the meantime. The lock may be held by the caller."""
        folder, start = self._stamp(), time.monotonic()
        index = up_to_date(self._archive)
        with self._lock:
            if self._known is None or start > self._when:
                self._known, self._when, self._folder = index, start, folder
        return index

    def _renew_behind(self) -> None:
        try:
            self._renew()
        finally:
            self._renewing.clear()

    def _stamp(self) -> int:
        """A value that changes when a run is added; 0 for an object store."""
        runs = self._archive.root / "runs"
        return runs.stat().st_mtime_ns if isinstance(runs, Path) and runs.is_dir() else 0
