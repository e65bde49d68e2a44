"""Dwells with far more scatter than the others: spikes, torn words."""

from collections.abc import Iterator

import numpy as np

from inertial.arrays import Flags
from inertial.counts import number_of
from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def noisy(readings: Readings) -> Iterator[Fault]:
    """Dwells whose scatter is far above the unit's own and the lot's: spikes on an axis, torn words on all."""
    if readings.spread is None:
        return
    typical = np.nanmedian(readings.spread, axis=1, keepdims=True)
    ratio = readings.spread / np.where(typical > 0.0, typical, np.inf)
    common = np.nanmedian(ratio, axis=0, keepdims=True) if len(ratio) > 2 else np.ones((1, *ratio.shape[1:]))
    loud: Flags = np.logical_and(ratio > 5.0, ratio > 3.0 * common)
    few = np.count_nonzero(loud.any(axis=-1), axis=1) < 3
    loud &= ~(few[:, None, None] & (ratio < 10.0))  # one noisy dwell is a transient, not a fault of the reading
    if readings.vibration is not None:
        level = np.nanmedian(readings.vibration, axis=1, keepdims=True)
        loud &= ~(readings.vibration > 2.0 * np.maximum(level, 1e-12))[..., None]
    for unit, row in enumerate(np.asarray(loud)):
        dwells = np.flatnonzero(row.any(axis=-1))
        if not dwells.size:
            continue
        together = float(np.mean(row[dwells].sum(axis=-1)))
        name = "torn_words" if together > 2.0 and dwells.size >= 3 else "spikes"
        worst = float(np.nanmax(np.where(row, ratio[unit], 0.0)))
        yield Fault(
            name,
            unit,
            tuple(dwells.tolist()),
            f"scatter up to {worst:.0f} times the unit's own in {number_of(dwells.size, 'dwell')}",
        )


LOOK = Look(noisy, ("torn_words", "spikes"), order=110, order_in_one_pose=50)
