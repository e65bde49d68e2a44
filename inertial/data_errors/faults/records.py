"""Gaps of a unit's record: missing dwells, missing samples, wrong order of time."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, look, places_of
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


@look(10, in_one_pose=True)
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
        yield Fault(name, unit, places_of(missing), f"{missing.size} of {row.size} dwells of the lot are missing")
    if _cut_off(readings):
        for unit in range(len(there)):
            yield Fault(
                "truncated_file",
                unit,
                (),
                "the record of temperature continues, and the last round of poses is incomplete",
            )


def missing_dwells(readings: Readings, unit: int) -> tuple[int, ...]:
    """Places of the dwells that a unit lacks and other units have."""
    return places_of(np.flatnonzero(~readings.there[unit]))


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


@look(20, in_one_pose=True)
def clock(readings: Readings) -> Iterator[Fault]:
    """Time that runs backwards from one dwell to the next."""
    for unit, time in enumerate(readings.time):
        row = readings.there[unit]
        back = np.flatnonzero(np.diff(time[row]) < 0.0)
        if back.size:
            places = np.flatnonzero(row)[back + 1]
            step = float(np.diff(time[row])[back[0]])
            yield Fault(
                "clock_jitter", unit, places_of(places), f"time steps back by {-step:.1f} s at dwell {places[0]}"
            )


@look(150, in_one_pose=True)
def dropped(readings: Readings) -> Iterator[Fault]:
    """Dwells with fewer samples than the lot has there, or than their duration holds."""
    if readings.count is None:
        return
    if len(readings.count) > 2 and not _of_own_lengths(readings):
        expected = np.nanmedian(readings.count, axis=0, keepdims=True)
    elif readings.duration is not None:
        rate = np.nanmedian(readings.count / np.maximum(readings.duration, 1e-9), axis=1, keepdims=True)
        expected = rate * readings.duration
    else:
        expected = np.nanmedian(readings.count, axis=1, keepdims=True)
        if np.nanmean(np.abs(readings.count / expected - 1.0) > 0.1) > 0.4:
            return  # dwells of planned different length
    for unit, row in enumerate(readings.count / np.maximum(expected, 1e-9)):
        places = np.flatnonzero(row < 0.85)
        if places.size:
            worst = float(np.nanmin(row))
            yield Fault(
                "dropped_samples",
                unit,
                places_of(places),
                f"{places.size} dwells hold as little as {worst:.0%} of the samples",
            )


def _of_own_lengths(readings: Readings) -> bool:
    """Whether dwells of one number last differently long in different units, as where a unit's dwells were numbered again."""
    if readings.duration is None:
        return False
    usual = np.nanmedian(readings.duration, axis=0, keepdims=True)
    return bool(np.nanmean(np.abs(readings.duration / np.maximum(usual, 1e-9) - 1.0) > 0.1) > 0.1)
