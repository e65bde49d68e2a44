"""Values that belong to a unit and to a place at once: the parts of both, apart."""

import numpy as np

from inertial.arrays import Array, Index

ROUNDS = 60
SETTLED = 1e-6


def unit_and_place(values: Array, units: Index, places: Index) -> tuple[Array, Array]:
    """Parts of the units and of the places, by medians in turn: single wild values move neither.

    Parameters
    ----------
    values : (n,); units, places : (n,), numbers from 0

    Returns
    -------
    Part of every unit, part of every place; the places' median is zero.
    """
    of_units, of_places = np.zeros(int(units.max()) + 1), np.zeros(int(places.max()) + 1)
    in_units, in_places = _groups(units), _groups(places)
    for _ in range(ROUNDS):
        of_units = _medians(values - of_places[places], in_units)
        refined = _medians(values - of_units[units], in_places)
        refined -= np.median(refined)
        moved, of_places = np.max(np.abs(refined - of_places)), refined
        if moved < SETTLED * (np.ptp(values) + 1e-300):
            break
    return of_units, of_places


def group_medians(values: Array, codes: Index) -> Array:
    """Median of every group, (groups,), zero where it is empty; values (n,), codes (n,) from 0."""
    return _medians(values, _groups(codes))


def _groups(codes: Index) -> tuple[Index, Index, Index]:
    """Codes, and where each group begins and how long it is."""
    counts = np.bincount(codes)
    return codes, np.concatenate([[0], np.cumsum(counts)[:-1]]), counts


def _medians(values: Array, groups: tuple[Index, Index, Index]) -> Array:
    """Median of every group, zero where it is empty."""
    codes, starts, counts = groups
    ordered = values[np.lexsort((values, codes))]
    low = np.minimum(starts + np.maximum(counts - 1, 0) // 2, values.size - 1)
    high = np.minimum(starts + counts // 2, values.size - 1)
    return np.where(counts > 0, 0.5 * (ordered[low] + ordered[high]), 0.0)
