"""Conversion of tables of older versions to the present schema in memory; files stay unchanged.

A change of a table's columns raises :data:`schemas.version.VERSION` by one and adds a line to :data:`UPGRADES`: the conversion
of a table from the version before. ``tests/archives`` keeps an archive of every version.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from schemas.version import VERSION, refuse_newer

if TYPE_CHECKING:
    import pandas as pd

UPGRADES: dict[tuple[str, int], Callable[[pd.DataFrame], pd.DataFrame]] = {}
"""By table and version: the conversion to the next version."""


def upgraded(name: str, frame: pd.DataFrame, version: int, where: str) -> pd.DataFrame:
    """The table in the schema of this version.

    Parameters
    ----------
    version : schema version of the table.
    where : name of the file in messages.
    """
    refuse_newer(version, where)
    for step in range(version, VERSION):
        change = UPGRADES.get((name, step))
        frame = frame if change is None else change(frame)
    return frame
