"""The samples behind a dwell, from the capture of a run or from an imported record."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from pipelines.archive import Archive
from schemas.errors import WrongUse


def samples_of(
    archive: Archive, run: str, dwell: str, read: Callable[[str], pd.DataFrame]
) -> tuple[pd.DataFrame, str, str]:
    """Samples of a dwell ``UNIT:DWELL``, the unit of their values, and a title.

    Parameters
    ----------
    read : gives a table of the run by its name

    Raises
    ------
    WrongUse
        There is no such dwell, or its samples were not recorded.
    """
    stored = archive.run(run)
    unit, _, number = dwell.rpartition(":")
    table = read("dwells")
    rows = table[(table["unit"] == unit) & (table["dwell"].astype(str) == number)]
    if rows.empty:
        raise WrongUse(f"run {stored.id} has no dwell '{dwell[:80]}'; click a residual")
    row = rows.iloc[0]
    record = int(row["record"]) if "record" in rows.columns else int(number)
    if stored.records is not None:
        tables = list(stored.records.samples({record}))
    elif "samples" in stored.tables():
        samples = read("samples")
        tables = [samples[samples["record"] == record]]
    else:
        raise WrongUse(f"run {stored.id} was imported as dwells: its samples were not recorded")
    own = [one[one["unit"] == unit] for one in tables]
    kept = [one for one in own if len(one)]
    if not kept:
        raise WrongUse(f"run {stored.id}: no samples of dwell {number} of unit {unit} are stored")
    out_unit = str(row["out_unit"]) if "out_unit" in rows.columns else ""
    pose = str(row["pose"]) if "pose" in rows.columns else ""
    return (
        pd.concat(kept, ignore_index=True),
        out_unit,
        f"Unit {unit}, dwell {number}{', pose ' + pose if pose else ''}",
    )
