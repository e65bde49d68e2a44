"""Serials that two units must have: no unit is two kinds of device, or on two stations at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from pipelines.audit.calibrations import Calibrations

AT_ONCE_D = 1.0 / 96.0  # a quarter of an hour: no unit is measured, taken off and soaked again in less


class Twice(NamedTuple):
    """A serial that two units have: rows of two calibrations that cannot be of one unit."""

    serial: str
    first: int
    second: int


def twice(all_: Calibrations) -> list[Twice]:
    """Serials under which two units were measured, in their order, each once."""
    order = np.lexsort((all_.day, all_.unit.astype(str)))
    unit, device, station = (column[order] for column in (all_.unit, all_.device, all_.station))
    same = unit[1:] == unit[:-1]
    close = (np.diff(all_.day[order]) < AT_ONCE_D) & (station[1:] != station[:-1])
    found: dict[str, Twice] = {}
    for k in np.flatnonzero(same & ((device[1:] != device[:-1]) | close)):
        serial = str(unit[k])
        found.setdefault(serial, Twice(serial, int(order[k]), int(order[k + 1])))
    return list(found.values())
