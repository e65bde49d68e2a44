"""A calibration that changes during the run: cables exchanged, or another range."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings, exchanged, find_split


def changed_units(readings: Readings) -> Iterator[Fault]:
    """A calibration that changes during the run: to that of another unit (cables exchanged), or to another range."""
    splits = {u: s for u, o in enumerate(readings.output) if (s := find_split(readings.force[u], o)) is not None}
    for unit, split in splits.items():
        dwells = tuple(range(split.dwell, int(np.flatnonzero(readings.there[unit])[-1]) + 1))
        partner = next((v for v, other in splits.items() if v != unit and exchanged(split, other)), None)
        if partner is not None:
            evidence = f"from dwell {{dwell[{split.dwell}]}} on it has the calibration of unit {{unit[{partner}]}}"
            yield Fault("units_swapped", unit, dwells, evidence)
        elif not 0.75 < split.ratio < 1.33:
            evidence = f"scale changes by a factor {split.ratio:.3g} at dwell {{dwell[{split.dwell}]}}"
            yield Fault("wrong_range", unit, dwells, evidence)


LOOK = Look(changed_units, ("units_swapped", "wrong_range"), order=50)
