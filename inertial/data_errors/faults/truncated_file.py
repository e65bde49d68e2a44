"""A record that ends before the lot's, or that lacks most dwells."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings

ENDS_EARLY = 3
"""Smallest number of dwells missing at the end of a unit's record for which the record counts as truncated.

One or two missing at the end are as likely as any others; a change within the last three would not be visible either.
"""

MOST_MISSING = 0.5
"""Largest share of missing dwells at which a unit is judged by its other dwells.

Derived: a plan usually has at least two dwells per coefficient, so that half of them still determine the model; a unit with fewer
contributes less to the lot than the unknown cause puts at risk.
"""


def truncated(readings: Readings) -> Iterator[Fault]:
    """A record that ends before the lot's, or that lacks most dwells; a unit with fewer gaps is judged by the dwells it has."""
    there = readings.there
    for unit, row in enumerate(there):
        missing = np.flatnonzero(~row)
        if not missing.size:
            continue
        ended = _after_end(readings, unit)
        if ended >= max(ENDS_EARLY, 0.5 * missing.size):
            name = "truncated_file"
        elif missing.size > MOST_MISSING * row.size or not row.any():
            name = "dropped_samples"
        else:
            continue
        yield Fault(name, unit, tuple(missing.tolist()), f"{missing.size} of {row.size} dwells of the lot are missing")
    if _cut_off(readings):
        evidence = "the record of temperature continues, and the last round of poses is incomplete"
        yield from (Fault("truncated_file", unit, (), evidence) for unit in range(len(there)))


def _after_end(readings: Readings, unit: int) -> float:
    """Number of dwells of the lot after the end of a unit's record: the smaller of the counts by dwell numbers and by times.

    Dwells renumbered without gaps end at the time of the others, and a clock that runs backwards ends at their last number.
    """
    row = readings.there[unit]
    others = np.delete(readings.time, unit, axis=0)
    if not row.any() or not len(others):
        return float(row.size)
    last = int(np.flatnonzero(row)[-1])
    theirs = np.isfinite(others).any(axis=0)
    typical = np.nanmedian(others[:, theirs], axis=0)
    behind = readings.time[unit, theirs] - typical
    if not np.isfinite(behind).any():
        return float(row.size - 1 - last)  # no dwell in common
    away = float(np.nanmedian(behind))
    own_day = abs(away) > float(np.ptp(typical))  # measured before or after the others
    end = readings.time[unit, last] - (away if own_day else 0.0)
    return min(float(row.size - 1 - last), float(np.median(np.sum(others > end, axis=1))))


def _cut_off(readings: Readings) -> bool:
    """Whether the temperature history continues long after the last dwell, which is in the middle of a round of poses."""
    time = np.nanmedian(readings.time, axis=0)
    if readings.history_end is None or readings.history_end - time[-1] < 0.15 * float(np.ptp(time)):
        return False
    _, counts = np.unique(np.round(readings.force[0], 3), axis=0, return_counts=True)
    return bool(counts.max() == counts.min() + 1 and counts.min() >= 2)


LOOK = Look(truncated, ("truncated_file", "dropped_samples"), order=10, order_in_one_pose=10, of_missing=True)
