"""A record that ends before the lot's, or that lacks most dwells."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings

ENDS_EARLY = 3
"""Dwells that the lot has after the last one of a unit, from which on the unit's record ends in the middle.

One or two at the end are as likely missing as any others; a change within the last three could not be seen either.
"""

MOST_MISSING = 0.5
"""Share of the dwells up to which a unit may lack some and is judged by the others.

Derived: a plan has at least two dwells per coefficient as a rule, so that half of them still determine the model; a unit that
has less than half of its dwells weighs less in the lot than what is unknown about the cause.
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
    """How many dwells the lot has after the end of a unit's record: by their numbers, and by the times of the other units.

    Dwells that were numbered again without the missing ones end with the record of the others, and a clock that runs back ends
    with its last number.
    """
    row = readings.there[unit]
    others = np.delete(readings.time, unit, axis=0)
    if not row.any() or not len(others):
        return float(row.size)
    typical = np.nanmedian(others, axis=0)
    away = float(np.nanmedian(readings.time[unit] - typical))
    own_day = abs(away) > float(np.nanmax(typical) - np.nanmin(typical))  # measured before or after the others
    last = int(np.flatnonzero(row)[-1])
    end = readings.time[unit, last] - (away if own_day else 0.0)
    return min(float(row.size - 1 - last), float(np.median(np.sum(others > end, axis=1))))


def _cut_off(readings: Readings) -> bool:
    """Whether the temperature's history runs on far behind the last dwell, which ends in the middle of a round of poses."""
    time = np.nanmedian(readings.time, axis=0)
    if readings.history_end is None or readings.history_end - time[-1] < 0.15 * float(np.ptp(time)):
        return False
    _, counts = np.unique(np.round(readings.force[0], 3), axis=0, return_counts=True)
    return bool(counts.max() == counts.min() + 1 and counts.min() >= 2)


LOOK = Look(truncated, ("truncated_file", "dropped_samples"), order=10, order_in_one_pose=10, of_missing=True)
