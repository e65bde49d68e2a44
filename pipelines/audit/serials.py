"""Serials of two units: a unit cannot be two kinds of device, or on two stations at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from pipelines.audit.calibrations import Calibrations

AT_ONCE_D = 1.0 / 96.0  # a quarter of an hour: moving and soaking a unit takes longer


class Twice(NamedTuple):
    """A serial of two units: rows of two calibrations that cannot be of one unit."""

    serial: str
    first: int
    second: int


def twice(calibrations: Calibrations) -> list[Twice]:
    """Serials of two units, in order, each once."""
    order = np.lexsort((calibrations.day, calibrations.unit.astype(str)))
    unit, device, station = (column[order] for column in (calibrations.unit, calibrations.device, calibrations.station))
    same = unit[1:] == unit[:-1]
    close = (np.diff(calibrations.day[order]) < AT_ONCE_D) & (station[1:] != station[:-1])
    by_serial: dict[str, Twice] = {}
    for k in np.flatnonzero(same & ((device[1:] != device[:-1]) | close)):
        serial = str(unit[k])
        by_serial.setdefault(serial, Twice(serial, int(order[k]), int(order[k + 1])))
    return list(by_serial.values())
