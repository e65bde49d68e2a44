"""Check of the table's pointing against its encoders by the lot itself: every unit is an inclinometer.

An encoder that has lost its zero, or a worn gear, turns the true force away from the assumed one, equally for all units. Errors
that differ between units are errors of the units, not of the table.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial.pointing import _force, pointing_error
from pipelines.tables.samples import STATIC
from schemas.units import AXES

Array = NDArray[np.float64]


def pointing_of(means: pd.DataFrame, readings: pd.DataFrame) -> float:
    """The largest pointing error of a run's soaks, from the mean outputs and the readings of its static dwells.

    Parameters
    ----------
    means : unit, record and the mean outputs x, y, z; a unit with a gap in a soak does not count there
    """
    static = readings[(readings["kind"] != STATIC)].drop_duplicates("record").set_index("record").sort_index()
    return max((_of_soak(means, rows) for _, rows in static.groupby("soak")), default=0.0)


def _of_soak(means: pd.DataFrame, static: pd.DataFrame) -> float:
    kept = [_by_record(rows, static.index) for _, rows in means.groupby("unit")]
    whole = [table for table in kept if np.all(np.isfinite(table))]
    if not whole:
        return 0.0
    return pointing_error(_force(static[["outer_deg", "inner_deg"]].to_numpy(dtype=float)), np.stack(whole, axis=1))


def _by_record(rows: pd.DataFrame, records: pd.Index) -> Array:
    """Mean outputs (n, 3) of one unit in order of record; NaN where one is missing."""
    return rows.set_index("record")[list(AXES)].reindex(records).to_numpy(dtype=float)
