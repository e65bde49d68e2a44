"""The index of the audit grows with every run: who finishes a run adds its rows, so that an audit reads no old files.

Each addition is a small part; when there are many they are made anew as one. Whatever is missing is added by the next audit.
"""

import logging
from collections.abc import Sequence
from pathlib import Path

import pyarrow.parquet as pq

from pipelines.archive import Archive
from pipelines.archive.locks import alone
from pipelines.archive.store import Place, address_of, first_line
from pipelines.audit import index
from pipelines.audit.index import FOLDER, MOST_SMALL, RUNS_PER_PART, Portion
from pipelines.audit.run_files import stamps_among
from schemas.errors import TumblelineError

LOGGER = logging.getLogger("tumbleline.archive")


def add_runs(archive: Archive, runs: Sequence[str]) -> int:
    """Add finished runs to the index of a local archive; the number of runs in the new part.

    The index is derived: an error is a warning, and an archive in an object store waits for its next audit, which lists it once.
    """
    if not isinstance(archive.root, Path) or not runs:
        return 0
    try:
        return _added(archive, archive.root, runs)
    except (TumblelineError, OSError, ValueError) as problem:
        LOGGER.warning("archive: the index was not extended (%s); the next audit does it", first_line(problem))
        return 0


def _added(archive: Archive, root: Path, runs: Sequence[str]) -> int:
    folder, version = root / FOLDER, index.version_of_rows()
    with alone(folder, wait=True):
        small = [part for part in index.part_folders(folder) if _rows(part) < RUNS_PER_PART // 2]
        merged = small if len(small) >= MOST_SMALL else []
        before = {run for part in merged for run in index.runs_of(part, version)}
        stamps = stamps_among(root, sorted({*before, *runs}))
        portion = Portion(address_of(archive.root), "", tuple(stamps.items()), version)
        new = index.make_part(portion)
        index.remove_parts(folder, [part for part in merged if part.name != new])
    return len(portion.runs)


def _rows(part: Place) -> int:
    """Number of runs in a part; none where it cannot be read: it is made again."""
    try:
        return pq.read_metadata(str(part / "runs.parquet")).num_rows
    except (OSError, ValueError):  # ArrowInvalid is a ValueError
        return 0
