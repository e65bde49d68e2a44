"""The version of the tables' schemas, which is written into every file, and the conversion of tables of older versions in memory.

A change of the columns of a table raises :data:`VERSION` by one and adds a line to :data:`UPGRADES`, the conversion from the
version before. ``tests/archives`` keeps an archive of every version.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    import pandas as pd

VERSION = 1
UPGRADES: "dict[tuple[str, int], Callable[[pd.DataFrame], pd.DataFrame]]" = {}
"""By table and version: the conversion to the next version."""


def refuse_newer(version: object, where: str) -> None:
    """Refuse files of a newer version, whose columns may have another meaning; ``where``: name of the file in messages."""
    if isinstance(version, int) and version > VERSION:
        raise ArchiveUnusable(
            f"archive: {where} has schema {version}, this version knows up to {VERSION}; use a newer version"
        )


def upgraded(name: str, frame: "pd.DataFrame", version: int, where: str) -> "pd.DataFrame":
    """The table, of an older schema version, in that of this version; its file stays unchanged."""
    refuse_newer(version, where)
    for step in range(version, VERSION):
        change = UPGRADES.get((name, step))
        frame = frame if change is None else change(frame)
    return frame
