"""Tables without rows, for stages that are left without an accepted unit."""

from __future__ import annotations

from functools import cache

import pandas as pd


def empty_table(*, texts: str = "", numbers: str = "", whole: str = "", flags: str = "") -> pd.DataFrame:
    """A table without rows whose columns, named in blank-separated lists, have the right types."""
    return _made(texts, numbers, whole, flags).copy()


@cache
def _made(texts: str, numbers: str, whole: str, flags: str) -> pd.DataFrame:
    kinds = {"str": texts, "float64": numbers, "int64": whole, "bool": flags}
    return pd.DataFrame({name: pd.Series(dtype=kind) for kind, names in kinds.items() for name in names.split()})
