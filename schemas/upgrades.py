"""Tables as older versions wrote them, brought up to what this version reads; files stay as they are.

A change of a table's columns raises :data:`schemas.version.VERSION` by one and adds a line to :data:`UPGRADES`: what makes of a
table of the version before one of the new. ``tests/archives`` keeps an archive of every version.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.version import VERSION, refuse_newer

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd

UPGRADES: dict[tuple[str, int], Callable[[pd.DataFrame], pd.DataFrame]] = {}
"""By table and the version that wrote it: the same table as the next version would have written it."""


def upgraded(name: str, frame: pd.DataFrame, version: int, where: str) -> pd.DataFrame:
    """The table as this version reads it.

    Parameters
    ----------
    version : of the schema that the table was written with.
    where : names the file in a message.
    """
    refuse_newer(version, where)
    for step in range(version, VERSION):
        change = UPGRADES.get((name, step))
        frame = frame if change is None else change(frame)
    return frame
