"""Numbers of the dwells of an import: those of the file, by which its owner names a dwell, where they number its dwells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from inertial.arrays import Index
from pipelines.importers.values import BOUNDS


def dwell_numbers(labels: Sequence[str], serials: Sequence[str]) -> tuple[Index, tuple[str, ...]]:
    """Numbers of dwells (n,), and a remark where whole numbers of the file are labels only.

    A number names one dwell of a unit, and grows in the order of measurement. Dwells of one number in several units belong
    together in a fit: numbers that run on from one unit to the next count rows.

    Parameters
    ----------
    labels, serials : label and unit of every dwell, in the order of measurement of each unit
    """
    units: Index = pd.factorize(np.asarray(serials, dtype=object))[0].astype(np.int64)
    order: Index = pd.Series(units).groupby(units).cumcount().to_numpy().astype(np.int64)
    stated = np.asarray(pd.to_numeric(pd.Series([*labels]), errors="coerce"), dtype=np.float64)
    if not np.all((stated == np.rint(stated)) & (stated >= BOUNDS["dwell"][0]) & (stated <= BOUNDS["dwell"][1])):
        return order, ()
    numbers = stated.astype(np.int64)
    by_unit = np.argsort(units, kind="stable")
    grows = np.diff(numbers[by_unit])[np.diff(units[by_unit]) == 0] > 0
    alone = units.max(initial=0) > 0 and np.unique(numbers).size == numbers.size > units.max() + 1
    if np.all(grows) and not alone:
        return numbers, ()
    why = "run on from unit to unit" if alone else "repeat or go back within a unit"
    return order, (f"dwells are numbered from 0 in each unit: the numbers of the file {why}, and are labels only",)
