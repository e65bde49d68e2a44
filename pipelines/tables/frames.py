"""The rows of a table by unit, as arrays: every column is read once, for any number of units."""

from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pandas.api.extensions import ExtensionArray


class ByUnit:
    """A table with access to the rows of each unit."""

    def __init__(self, table: pd.DataFrame) -> None:
        self._table, self._columns = table, dict[str, "NDArray[Any]"]()
        self._units = table["unit"].to_numpy(dtype=object)
        turns = np.flatnonzero(self._units[1:] != self._units[:-1]) + 1
        bounds = [0, *turns.tolist(), len(self._units)] if len(self._units) else [0]
        self._places = {self._units[start]: slice(start, end) for start, end in pairwise(bounds)}
        self._together = len(self._places) == len(bounds) - 1

    @property
    def units(self) -> list[str]:
        """The units, in the order of their first rows."""
        return list(self._places)

    def __contains__(self, name: str) -> bool:
        return name in self._table

    def column(self, name: str) -> NDArray[Any]:
        """A column of the table, (rows,)."""
        if name not in self._columns:
            # slices of a contiguous array are fast
            self._columns[name] = np.ascontiguousarray(self._table[name].to_numpy())
        return self._columns[name]

    def of(self, unit: str) -> "UnitRows":
        """The rows of a unit, in their order; empty for an unknown unit."""
        if self._together:
            return UnitRows(self, self._places.get(unit, slice(0, 0)))
        return UnitRows(self, np.flatnonzero(self._units == unit))


class UnitRows:
    """The rows of one unit: ``rows[column]`` is an array (rows,)."""

    def __init__(self, table: ByUnit, where: slice | NDArray[np.intp]) -> None:
        self._table, self._where = table, where
        self._count = where.stop - where.start if isinstance(where, slice) else len(where)

    def __len__(self) -> int:
        return self._count

    def __contains__(self, column: str) -> bool:
        """Whether the table has a column; older runs lack some."""
        return column in self._table

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self._table.column(column)[self._where]


def picked(texts: Sequence[str], places: NDArray[np.intp]) -> ExtensionArray:
    """The texts of some indices, (rows,), as a column."""
    return _column(tuple(texts)).take(places)


@lru_cache(maxsize=64)
def _column(texts: tuple[str, ...]) -> ExtensionArray:
    """Texts as a column; the units and poses of a lot are picked many times."""
    return pd.array(np.asarray(texts, dtype=object), dtype="str")


def empty_table(*, texts: str = "", numbers: str = "", integers: str = "", flags: str = "") -> pd.DataFrame:
    """A table without rows whose columns, named in blank-separated lists, have the right types."""
    return _made(texts, numbers, integers, flags).copy()


@cache
def _made(texts: str, numbers: str, integers: str, flags: str) -> pd.DataFrame:
    kinds = {"str": texts, "float64": numbers, "int64": integers, "bool": flags}
    return pd.DataFrame({name: pd.Series(dtype=kind) for kind, names in kinds.items() for name in names.split()})


def rows_of(table: pd.DataFrame) -> list[dict[str, Any]]:
    """One dictionary per row, by column name."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def own_rows(table: pd.DataFrame, dwells: pd.DataFrame) -> pd.DataFrame:
    """The rows of the units of some dwells; all of a table without units."""
    return table[table["unit"].isin(dwells["unit"].unique())] if "unit" in table.columns else table


def joined_parts(parts: Sequence[dict[str, pd.DataFrame]]) -> dict[str, pd.DataFrame]:
    """Tables of the parts of a lot as those of the lot, in order of its units."""
    if len(parts) == 1:
        return parts[0]
    tables = {name: [made[name] for made in parts if len(made[name])] or [parts[0][name]] for name in parts[0]}
    return {
        name: pd.concat(rows).sort_values("unit", kind="stable", ignore_index=True) for name, rows in tables.items()
    }
