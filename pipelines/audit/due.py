"""Which units are to be calibrated again, and when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipelines.audit.drifts import MONTH_D

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pipelines.audit.calibrations import Calibrations
    from pipelines.audit.drifts import KindDrift, UnitDrift
    from pipelines.audit.rules import Rules

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Due:
    """The last calibrations of the units, in order of unit: row among the calibrations, day when each is due, and why then.

    months : the interval that counted; because : ``fixed``, ``drift`` or ``never passed``
    """

    row: NDArray[np.int64]
    day: Array
    months: Array
    because: NDArray[np.object_]


def due(
    all_: Calibrations, good: Flags, rules: Rules, kinds: list[KindDrift], units: Mapping[str, list[UnitDrift]]
) -> Due:
    """When every unit is due: a fixed interval of its kind after its last pass, or when its drift uses its reliability up.

    By drift the interval is that of the unit's own forecast where it has a history, else of its kind's, inside the rules' bounds.
    """
    rows = np.flatnonzero(good)
    last = rows[np.concatenate([all_.histories[rows[1:]] != all_.histories[rows[:-1]], [True]])] if rows.size else rows
    fixed = {device: float(rules.months(device)) for device in np.unique(all_.device.astype(str))}
    months = np.array([fixed[str(device)] for device in all_.device[last]])
    because = np.full(last.size, "fixed", dtype=object)
    if rules.interval == "drift":
        months, because = _by_drift(all_, last, months, rules, kinds, units)
    passed = all_.outcome[last] == "pass"
    unknown = all_.outcome[last] == ""  # imported results have no decision: they count
    day = np.where(passed | unknown, _months_after(all_.day[last], months), all_.day[last])
    because = np.where(passed | unknown, because, "did not pass")
    return Due(last, day, months, because)


def _by_drift(
    all_: Calibrations,
    last: NDArray[np.int64],
    fixed: Array,
    rules: Rules,
    kinds: list[KindDrift],
    units: Mapping[str, list[UnitDrift]],
) -> tuple[Array, NDArray[np.object_]]:
    of_kind: dict[str, float] = {}
    for kind in kinds:
        if np.isfinite(kind.reliable_months):
            of_kind[kind.device] = min(of_kind.get(kind.device, np.inf), kind.reliable_months)
    months, because = fixed.copy(), np.full(last.size, "fixed", dtype=object)
    for k, row in enumerate(last):
        device = str(all_.device[row])
        own = [(d.reliable_day - d.day) / MONTH_D for d in units.get(f"{device} {all_.unit[row]}", ())]
        found = min(own) if own else of_kind.get(device, np.nan)
        if np.isfinite(found):
            months[k] = np.clip(np.floor(found), rules.shortest_months, rules.longest_months)
            because[k] = "drift"
    return months, because


def _months_after(day: Array, months: Array) -> Array:
    """The same day of the month so many months later, or the last of a month that has no such day; days since 1970."""
    date = np.floor(day).astype("datetime64[D]")
    month = date.astype("datetime64[M]")
    of_month = (date - month.astype("datetime64[D]")).astype(int)
    target = month + months.astype(int).astype("timedelta64[M]")
    length = ((target + np.timedelta64(1, "M")).astype("datetime64[D]") - target.astype("datetime64[D]")).astype(int)
    return (target.astype("datetime64[D]") + np.minimum(of_month, length - 1).astype("timedelta64[D]")).astype(float)
