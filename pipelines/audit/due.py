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
    from pipelines.audit.certificates import Certificates
    from pipelines.audit.drifts import KindDrift, UnitDrift
    from pipelines.audit.rules import Rules

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Due:
    """The last calibrations of the units, in order of unit: row among the calibrations, day when each is due, and why then.

    months : the interval that the rules give
    because : ``fixed`` or ``drift`` (the interval after the last pass), ``certificate`` (it ends, or has ended), ``revoked``, or
        ``did not pass``
    certificate : the one that holds on the day of the audit, else the one certified last; empty where there is none
    valid : whether one holds; entered : whether what was measured last is certified, in whatever state
    """

    row: NDArray[np.int64]
    day: Array
    months: Array
    because: NDArray[np.object_]
    certificate: NDArray[np.object_]
    valid: Flags
    entered: Flags


def due(
    all_: Calibrations,
    good: Flags,
    rules: Rules,
    kinds: list[KindDrift],
    units: Mapping[str, list[UnitDrift]],
    certificates: Certificates | None = None,
) -> Due:
    """When every unit is due: when its certificate ends, or did; at once where it was revoked or the unit did not pass.

    Without a certificate for its last measurement a unit is due a fixed interval of its kind after that. Where drift decides
    it is due when its drift uses its reliability up (by the unit's own forecast where it has a history, else by its kind's,
    inside the rules' bounds), unless its certificate ends before.
    """
    rows = np.flatnonzero(good)
    last = rows[np.concatenate([all_.histories[rows[1:]] != all_.histories[rows[:-1]], [True]])] if rows.size else rows
    fixed = {device: float(rules.months(device)) for device in np.unique(all_.device.astype(str))}
    months = np.array([fixed[str(device)] for device in all_.device[last]])
    because = np.full(last.size, "fixed", dtype=object)
    if rules.interval == "drift":
        months, because = _by_drift(all_, last, months, rules, kinds, units)
    found = Due(
        last,
        _months_after(all_.day[last], months),
        months,
        because,
        np.full(last.size, "", dtype=object),
        np.zeros(last.size, dtype=bool),
        np.zeros(last.size, dtype=bool),
    )
    if certificates is not None:
        _by_certificate(all_, found, certificates)
    # imported results have no decision: they count
    failed = (all_.outcome[last] != "pass") & (all_.outcome[last] != "")
    found.day[failed], found.because[failed] = all_.day[last][failed], "did not pass"
    return found


def last_measured(all_: Calibrations, found: Due, station: str) -> Due:
    """The units that a station measured last; all where none is named. What others measured before counts for their history."""
    if not station:
        return found
    own = all_.station[found.row] == station
    return Due(*(getattr(found, name)[own] for name in Due.__dataclass_fields__))


def uncertified(all_: Calibrations, found: Due, certificates: Certificates) -> NDArray[np.int64]:
    """Units that passed last and were not certified for it, as places among those that are due; none without a ledger."""
    if not len(certificates):
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero((all_.outcome[found.row] == "pass") & ~found.entered)


def _by_certificate(all_: Calibrations, found: Due, certificates: Certificates) -> None:
    """Put what the ledger says of every unit in the place of the interval."""
    for k, row in enumerate(found.row):
        one = certificates.standing(str(all_.device[row]), str(all_.unit[row]), str(all_.run[row]))
        if one is None:
            continue
        found.certificate[k], found.valid[k], found.entered[k] = one.certificate, one.state == "valid", one.entered
        if one.state != "valid" and not one.entered:  # measured again after it ended: the interval counts from that
            continue
        if found.because[k] == "drift" and one.state != "revoked" and found.day[k] < one.until:
            continue
        found.day[k], found.because[k] = one.until, "revoked" if one.state == "revoked" else "certificate"


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
