"""Dwells with fewer samples than they should have."""

from collections.abc import Iterator

import numpy as np

from inertial.counts import number_of
from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def dropped(readings: Readings) -> Iterator[Fault]:
    """Dwells with fewer samples than the lot has there, or than their duration holds."""
    if readings.count is None:
        return
    if len(readings.count) > 2 and not _durations_differ(readings):
        expected = np.nanmedian(readings.count, axis=0, keepdims=True)
    elif readings.duration is not None:
        rate = np.nanmedian(readings.count / np.maximum(readings.duration, 1e-9), axis=1, keepdims=True)
        expected = rate * readings.duration
    else:
        expected = np.nanmedian(readings.count, axis=1, keepdims=True)
        if np.nanmean(np.abs(readings.count / expected - 1.0) > 0.1) > 0.4:
            return  # dwells of planned different length
    for unit, row in enumerate(readings.count / np.maximum(expected, 1e-9)):
        dwells = np.flatnonzero(row < 0.85)
        if dwells.size:
            evidence = f"{number_of(dwells.size, 'dwell')} hold as little as {float(np.nanmin(row)):.0%} of the samples"
            yield Fault("dropped_samples", unit, tuple(dwells.tolist()), evidence)


def _durations_differ(readings: Readings) -> bool:
    """Whether dwells of the same number differ in duration between units, as if a unit's dwells had been renumbered."""
    if readings.duration is None:
        return False
    usual = np.nanmedian(readings.duration, axis=0, keepdims=True)
    return bool(np.nanmean(np.abs(readings.duration / np.maximum(usual, 1e-9) - 1.0) > 0.1) > 0.1)


LOOK = Look(dropped, ("dropped_samples",), order=150, order_in_one_pose=70)
