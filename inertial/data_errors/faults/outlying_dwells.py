"""Single dwells far off on one axis, where no scatter was recorded."""

from collections.abc import Iterator

import numpy as np

from inertial.counts import number_of
from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def outliers(readings: Readings) -> Iterator[Fault]:
    """Single dwells far off on one axis alone, where no scatter was recorded to show spikes."""
    if readings.spread is not None:
        return
    size = np.abs(readings.misfit_when_warm)
    typical = np.nanmedian(size, axis=1, keepdims=True)
    out = np.any(size > np.maximum(0.005, 40.0 * typical), axis=-1)
    for unit, row in enumerate(np.asarray(out)):
        dwells = np.flatnonzero(row)
        if 0 < dwells.size <= 0.1 * row.size:
            evidence = f"{number_of(dwells.size, 'dwell')} far from the others"
            yield Fault("spikes", unit, tuple(dwells.tolist()), evidence)


LOOK = Look(outliers, ("spikes",), order=120)
