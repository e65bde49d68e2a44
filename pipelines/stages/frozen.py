"""Frozen thermometers: readings that stay equal to the last digit although they should change.

While the chamber holds one temperature this is the only sign. How often the mean of a sound thermometer changes from one record
to the next is known from its own earlier records and from the other units at the same time; the smaller share is used.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

SAME_K = 1e-9  # means of equal readings differ by rounding
BY_CHANCE = 1e-6  # probability that a sound thermometer is refused


def frozen(readings: pd.DataFrame) -> Iterator[tuple[str, int, float]]:
    """Units whose thermometer froze before the end, with the number of equal records and the temperature, °C.

    Parameters
    ----------
    readings : of the units that answered
    """
    table = readings.pivot_table(index="record", columns="unit", values="unit_C").sort_index()
    soak = readings.drop_duplicates("record").set_index("record")["soak"].reindex(table.index).to_numpy()
    values = table.to_numpy(dtype=float)
    changed = np.abs(np.diff(values, axis=0)) > SAME_K
    known = np.isfinite(values[1:]) & np.isfinite(values[:-1])
    within = soak[1:] == soak[:-1]
    for column, unit in enumerate(table.columns):
        if not known[:, column].all():
            continue
        still = _unchanged_at_the_end(changed[:, column])
        if still and _by_chance(changed & known, known & within[:, None], column, still) < BY_CHANCE:
            yield str(unit), still + 1, float(values[-1, column])


def _unchanged_at_the_end(changed: NDArray[np.bool_]) -> int:
    """Steps from record to record, counted from the end, in which nothing changed."""
    moved = np.flatnonzero(changed)
    return len(changed) - (int(moved[-1]) + 1 if moved.size else 0)


def _by_chance(changed: NDArray[np.bool_], counted: NDArray[np.bool_], column: int, still: int) -> float:
    """Probability that the reading of a sound thermometer stays equal for so long; 1 if unknown.

    Parameters
    ----------
    changed, counted : (steps, units); a step within one soak is counted
    """
    steps = len(changed)
    own = counted[: steps - still, column]
    others = np.delete(counted[steps - still :], column, axis=1)
    rates = [
        float(np.sum(moved & there)) / (float(np.sum(there)) + 1.0)
        for moved, there in (
            (changed[: steps - still, column], own),
            (np.delete(changed[steps - still :], column, axis=1), others),
        )
        if there.any()
    ]
    return (1.0 - min(rates)) ** still if rates else 1.0
