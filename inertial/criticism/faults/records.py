"""Gaps of a unit's record: missing dwells, missing samples, wrong order of time."""

from collections.abc import Iterator

import numpy as np

from inertial.criticism.faults.fault import Fault, places_of
from inertial.criticism.readings import Readings


def truncated(readings: Readings) -> Iterator[Fault]:
    """Dwells that a unit lacks and the rest of the lot has: at the end, or in between."""
    there = readings.there
    for unit, row in enumerate(there):
        missing = np.flatnonzero(~row)
        if not missing.size:
            continue
        last = np.flatnonzero(row)[-1] if row.any() else -1
        at_end = missing[missing > last]
        name = "truncated_file" if at_end.size >= 0.5 * missing.size else "dropped_samples"
        yield Fault(name, unit, places_of(missing), f"{missing.size} of {row.size} dwells of the lot are missing")
    if there.all() and _cut_off(readings):
        for unit in range(len(there)):
            yield Fault(
                "truncated_file",
                unit,
                (),
                "the record of temperature continues, and the last round of poses is incomplete",
            )


def _cut_off(readings: Readings) -> bool:
    """Whether the temperature's history runs on far behind the last dwell, which ends in the middle of a round of poses."""
    time = readings.time[0]
    if readings.history_end is None or readings.history_end - time[-1] < 0.15 * float(np.ptp(time)):
        return False
    _, counts = np.unique(np.round(readings.force[0], 3), axis=0, return_counts=True)
    return bool(counts.max() == counts.min() + 1 and counts.min() >= 2)


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


def dropped(readings: Readings) -> Iterator[Fault]:
    """Dwells with fewer samples than the lot has there, or than their duration holds."""
    if readings.count is None:
        return
    if len(readings.count) > 2:
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
