"""Reduction of long runs: consecutive dwells of one pose are averaged, or only every k-th dwell is used."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial.quantities import BY_COLUMN

MOST = 500
"""Largest number of dwells of a unit for a full covariance: its size grows with the square, the work with the cube."""

_REFERENCE = ("force_x", "force_y", "force_z", "outer_deg", "inner_deg")
_SUMS = ("n", "duration_s")


def condense(dwells: pd.DataFrame) -> pd.DataFrame:
    """Dwells of which no unit has more than about :data:`MOST`: neighbours in one pose averaged, else thinned out.

    Averages keep the scatter ``sd_*`` and add the samples ``n``; texts are those of the first dwell.
    """
    numbers, size, group = _groups(dwells)
    if size <= 1:
        return dwells
    if group is None:
        return dwells[dwells["dwell"].isin(numbers[::size])]
    group_of = pd.Series(group, index=numbers)
    numeric = [c for c in dwells.columns if pd.api.types.is_numeric_dtype(dwells[c]) and c != "dwell"]
    how = {
        c: "sum" if c in _SUMS else BY_COLUMN[c].joined if c in BY_COLUMN else "mean" if c in numeric else "first"
        for c in dwells.columns
        if c not in ("unit", "dwell")
    }
    grouped = dwells.assign(dwell=dwells["dwell"].map(group_of)).groupby(["unit", "dwell"], as_index=False, sort=True)
    joined = grouped.agg(how)
    for axis in "xyz":
        # a single sample has no scatter: the scatter of the group is used
        scatter = joined[f"sd_{axis}"] if f"sd_{axis}" in joined.columns else pd.Series(np.nan, index=joined.index)
        joined[f"sd_{axis}"] = scatter.where(scatter > 0.0, grouped[f"out_{axis}"].std()[f"out_{axis}"])
    if "n" not in joined.columns:
        joined["n"] = grouped.size()["size"]
    full = grouped.size()["size"] >= 0.5 * size  # the remainder of a stretch is too short for a dwell
    return joined[full].dropna(subset=["sd_x", "sd_y", "sd_z"])


def reduction(dwells: pd.DataFrame) -> list[str]:
    """A notice of what :func:`condense` makes of the dwells; none where they are judged as they are."""
    numbers, size, group = _groups(dwells)
    if size <= 1:
        return []
    judged = f"one in {size}" if group is None else f"the mean of {size} neighbours in one pose"
    return [f"{len(numbers)} dwells are more than the {MOST} that can be judged at once: {judged} is judged"]


def _groups(dwells: pd.DataFrame) -> tuple[NDArray[np.int64], int, NDArray[np.int64] | None]:
    """Numbers of the dwells, how many make one, and the group of each; None where poses change too often, or are not known."""
    numbers = np.unique(dwells["dwell"].to_numpy())
    size = int(np.ceil(len(numbers) / MOST))
    columns = [c for c in _REFERENCE if c in dwells.columns]
    if not columns or size <= 1:
        return numbers, size, None
    first = dwells.drop_duplicates("dwell").sort_values("dwell")
    pose = np.round(first[columns].to_numpy(dtype=float), 4)
    moved = np.concatenate([[True], np.any(np.diff(pose, axis=0) != 0.0, axis=1)])
    if np.count_nonzero(moved) > len(numbers) / (2 * size):
        return numbers, size, None
    start = np.maximum.accumulate(np.where(moved, np.arange(len(numbers)), 0))
    new = moved | ((np.arange(len(numbers)) - start) % size == 0)
    return numbers, size, np.cumsum(new).astype(np.int64) - 1
