"""Dwells of an import that the fit does not use: its coefficients are verified with them."""

from __future__ import annotations

import numpy as np
import pandas as pd

from schemas.errors import DataRejected, WrongUse
from schemas.foreign import shown

FEWEST_FITTED = 12
"""Smallest number of dwells of a unit for the fit; the fit of a model with more coefficients states a larger one."""
_SEED = 140


def held_out_count(text: str, dwells: int) -> int:
    """The number of dwells to hold out: a number, or a share such as ``20%``.

    Raises
    ------
    WrongUse
        It is neither.
    """
    share = text.endswith("%")
    try:
        number = float(text.removesuffix("%"))
    except ValueError:
        number = float("nan")
    if not (0.0 < number < (100.0 if share else 1e6)) or (not share and number != int(number)):
        raise WrongUse(
            f"--verify: found '{shown(text)}', a number of dwells or a share such as 20% is needed; correct it"
        )
    return max(1, round(0.01 * number * dwells)) if share else int(number)


def with_held_out(dwells: pd.DataFrame, text: str, where: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The dwells with kind ``verification`` for those that are held out, and a remark that names them; none for an empty text.

    Of each unit one dwell is drawn from each of so many stretches of equal length; the first and the last dwell stay in the fit,
    so that it does not extrapolate in time. The draw depends on the number of dwells only.

    Raises
    ------
    DataRejected
        Too few dwells are left for the fit.
    """
    if not text:
        return dwells, ()
    kinds = dwells["kind"].astype(object).to_numpy().copy()
    named: list[str] = []
    for unit, places in dwells.groupby("unit", sort=False).indices.items():
        count = held_out_count(text, len(places))
        if len(places) - count < FEWEST_FITTED:
            raise DataRejected(
                f"{where}: {len(places)} dwells of unit {unit}, --verify {shown(text)} leaves {max(len(places) - count, 0)} "
                f"of them, {FEWEST_FITTED} are needed for the fit at least; hold out fewer, or measure more positions"
            )
        chosen = places[_drawn(len(places), count)]
        kinds[chosen] = "verification"
        named.append(f"{unit}: {', '.join(str(number) for number in dwells['dwell'].to_numpy()[chosen])}")
    return dwells.assign(kind=kinds), (f"held out for verification: {'; '.join(named)}",)


def _drawn(dwells: int, count: int) -> np.ndarray:
    """Places of ``count`` of ``dwells``, one in each stretch, neither the first nor the last."""
    rng = np.random.default_rng(_SEED + 1000 * dwells + count)
    edges = np.linspace(1, dwells - 1, count + 1)
    first = np.ceil(edges[:-1]).astype(np.int64)
    last = np.maximum(np.ceil(edges[1:]).astype(np.int64), first + 1)
    return rng.integers(first, last)
