"""Dwells that a person leaves out: their names as they are given, and the table without them."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import pandas as pd

from schemas.errors import DataRejected, WrongUse

Dwells: TypeAlias = "tuple[tuple[str, int], ...]"
"""Units and numbers of dwells."""


def named_dwells(text: str) -> Dwells:
    """The dwells of ``UNIT:DWELL,…``.

    Raises
    ------
    WrongUse
        A part is not of this form.
    """
    dwells: list[tuple[str, int]] = []
    for part in filter(None, (piece.strip() for piece in text.split(","))):
        unit, colon, dwell = part.rpartition(":")
        if not (colon and unit and dwell.isdigit()):
            raise WrongUse(f"--leave-out: found '{part[:60]}', UNIT:DWELL is needed, divided by commas; correct it")
        dwells.append((unit, int(dwell)))
    return tuple(dict.fromkeys(dwells))


def leave_out(dwells: pd.DataFrame, named: Sequence[tuple[str, int]]) -> pd.DataFrame:
    """The table without some dwells of some units.

    Raises
    ------
    DataRejected
        One of them is not there.
    """
    gone = np.zeros(len(dwells), dtype=bool)
    for unit, dwell in named:
        rows = (dwells["unit"].astype(str) == unit).to_numpy() & (dwells["dwell"] == dwell).to_numpy()
        if not rows.any():
            there = ", ".join(dict.fromkeys(dwells["unit"].astype(str)))
            raise DataRejected(
                f"--leave-out: dwell {dwell} of unit {unit} is not there (units {there}, dwells "
                f"{int(dwells['dwell'].min())} to {int(dwells['dwell'].max())}); name another"
            )
        gone |= rows
    return dwells[~gone].reset_index(drop=True)
