"""Single dwells whose readings were exchanged between two units."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings, design

_AWAY = 0.005
"""Distance, g, from its own calibration above which the output of a unit may be that of another."""


def swapped_units(readings: Readings) -> Iterator[Fault]:
    """Dwells exchanged between two units, recognised by the units' calibrations."""
    units, n = readings.there.shape
    if units < 2:
        return
    exchanged: dict[tuple[int, int], list[int]] = {}
    # a unit that fits its own calibration was not exchanged
    away = np.any(np.linalg.norm(readings.misfit, axis=-1) > _AWAY, axis=0)
    for dwell in np.flatnonzero(away).tolist():
        for pair in _exchanges(readings, dwell):
            exchanged.setdefault(pair, []).append(dwell)
    for (first, second), dwells in exchanged.items():
        if len(dwells) >= max(3, n // 20):
            for unit, partner in ((first, second), (second, first)):
                evidence = f"{len(dwells)} dwells have the bias and scale of unit {{unit[{partner}]}}"
                yield Fault("units_swapped", unit, tuple(dwells), evidence)


def _exchanges(readings: Readings, dwell: int) -> Iterator[tuple[int, int]]:
    """Pairs of units whose outputs at one dwell fit each other's calibration far better than their own."""
    there = np.flatnonzero(readings.there[:, dwell])
    predicted = np.einsum("vip,up->uvi", readings.fits[there], design(readings.force[there, dwell]))
    scale = readings.scale[there]
    distance = np.linalg.norm((readings.output[there, dwell][:, None] - predicted) / scale[:, None, None], axis=-1)
    to_own = np.diag(distance)
    best = np.argmin(distance, axis=1)
    for i, j in enumerate(best):
        mutual = j > i and best[j] == i
        if mutual and distance[i, j] < 0.2 * to_own[i] and distance[j, i] < 0.2 * to_own[j] and to_own[i] > _AWAY:
            yield int(there[i]), int(there[j])


LOOK = Look(swapped_units, ("units_swapped",), order=90)
