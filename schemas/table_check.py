"""The check of a table against its contract: the table with the right types, or a message with row, value and requirement."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from schemas.errors import DataRejected
from schemas.tables import TABLES, Column, Table

if TYPE_CHECKING:
    from pandera.errors import SchemaError

DIFFERENT = 2**62
_NONE = np.zeros(0, dtype=np.intp)


def check(name: str, frame: pd.DataFrame, *, where: str = "") -> pd.DataFrame:
    """The frame of a table of :data:`TABLES` with the right types, or :class:`DataRejected` with its source, ``where``."""
    table = TABLES[name]
    source = where or name
    _refuse_missing_columns(table, frame, source)
    if _plainly_right(table, frame):
        return frame
    _refuse_not_finite(table, frame, source)
    _refuse_twice(table, frame, source)
    from pandera.errors import SchemaError  # noqa: PLC0415 - a table without an error does not need it

    try:
        return table.schema.validate(frame)
    except SchemaError as problem:
        raise DataRejected(_explain(problem, frame, source)) from None


def _plainly_right(table: Table, frame: pd.DataFrame) -> bool:
    """Whether the frame meets its contract, by one pass over every column; a frame that does not is examined again in detail."""
    seen = {name: Seen.of(frame[name]) for name in {*table.columns, *table.finite, *table.key} & set(frame.columns)}
    rows = frame["status"].to_numpy() == "ok" if table.only_ok else slice(None)
    return (
        all(seen[name].is_right(column) for name, column in table.columns.items())
        and all(seen[name].is_finite(rows) for name in table.finite if name in seen)
        and all_different([seen[name] for name in table.key])
    )


def _refuse_missing_columns(table: Table, frame: pd.DataFrame, source: str) -> None:
    missing = [column for column in table.columns if column not in frame.columns]
    if missing:
        found = ", ".join(map(str, frame.columns)) or "none"
        raise DataRejected(
            f"{source}: column {', '.join(missing)} is missing, found {found}; add it, or map it to its name"
        )


def _refuse_not_finite(table: Table, frame: pd.DataFrame, source: str) -> None:
    rows = frame.loc[frame["status"] == "ok"] if table.only_ok else frame
    for column in table.finite:
        if column not in rows.columns:
            continue
        found = rows[column]
        plain = found.dtype == np.float64  # others are converted first, which is slower
        values = found.to_numpy() if plain else np.asarray(pd.to_numeric(found, errors="coerce"), dtype=float)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            index = rows.index[bad[0]]
            raise DataRejected(
                f"{source}: {_row(rows, index)}, column {column}: found {rows[column].loc[index]}, a finite number is "
                f"needed ({bad.size} such rows); measure again or leave the row out"
            )


def _refuse_twice(table: Table, frame: pd.DataFrame, source: str) -> None:
    if not table.key:
        return
    twice = frame.duplicated(list(table.key))
    if twice.any():
        index = frame.index[int(np.flatnonzero(twice.to_numpy())[0])]
        named = ", ".join(f"{column} {frame[column].loc[index]}" for column in table.key)
        raise DataRejected(
            f"{source}: row {index + 1}: {named} is there twice, it may be there once; remove one of the two"
        )


def _explain(problem: "SchemaError", frame: pd.DataFrame, source: str) -> str:
    column = getattr(problem.schema, "name", None) or "?"
    cases = problem.failure_cases
    if isinstance(cases, pd.DataFrame) and len(cases) and "index" in cases and pd.notna(cases["index"].iloc[0]):
        index, value = cases["index"].iloc[0], cases["failure_case"].iloc[0]
        # the requirement of the check, without the library's notation
        words = str(problem.check).removeprefix("<Check ").removesuffix(">")
        needed = words.split(": ", 1)[-1].replace("_", " ")
        return f"{source}: {_row(frame, index)}, column {column}: found {value}, {needed} is needed; correct the row"
    return f"{source}: column {column}: {str(problem).splitlines()[0]}; correct the column"


def _row(frame: pd.DataFrame, index: Any) -> str:
    unit = f" (unit {frame['unit'].loc[index]})" if "unit" in frame.columns else ""
    return f"row {index + 1}{unit}"


@cache
def _named(kind: Hashable) -> str:
    """The name of a type, cached, as the libraries compose it at each call."""
    return str(kind)


@dataclass(frozen=True)
class Seen:
    """A column.

    kind : name of its type; numbers : (rows,), its values where they are numbers or flags, None for texts
    codes : (rows,), index of each text, −1 where it is missing; texts : the different texts
    """

    kind: str
    numbers: NDArray[Any] | None
    codes: NDArray[np.intp]
    texts: tuple[object, ...] = ()

    @classmethod
    def of(cls, values: pd.Series) -> Self:
        """The analysis of a column."""
        if isinstance(values.dtype, np.dtype) and values.dtype.kind in "fiub":
            return cls(_named(values.dtype), values.to_numpy(), _NONE)
        codes, texts = values.factorize()
        return cls(str(values.dtype), None, codes, tuple(texts.tolist()))

    def is_right(self, column: Column) -> bool:
        """Whether the column has its type and passes its checks."""
        if self.kind != column.kind or (not column.missing and self._has_gaps()):
            return False
        if self.numbers is None:
            return not (column.filled and "" in self.texts) and (
                not column.allowed or set(self.texts) <= set(column.allowed)
            )
        return column.low is None or not bool((self.numbers < column.low).any())

    def is_finite(self, rows: slice | NDArray[np.bool_]) -> bool:
        """Whether the column has finite numbers in these rows."""
        return self.numbers is not None and bool(np.all(np.isfinite(self.numbers[rows])))

    def _has_gaps(self) -> bool:
        if self.numbers is None:
            return bool((self.codes < 0).any())
        return self.numbers.dtype.kind == "f" and bool(np.isnan(self.numbers).any())


def all_different(columns: Sequence[Seen]) -> bool:
    """Whether all rows differ in at least one of these columns; false, too, where there are too many values to decide."""
    combined, count = np.zeros(1, dtype=np.int64), 1
    for column in columns:
        codes, kinds = _codes_of(column)
        count *= kinds
        if count > DIFFERENT:
            return False
        combined = combined * kinds + codes
    return not columns or np.unique(combined).size == combined.size


def _codes_of(column: Seen) -> tuple[NDArray[np.int64], int]:
    """A code (rows,) from 0 for every value of a column, and the largest possible number of codes."""
    if column.numbers is None:
        return column.codes + 1, len(column.texts) + 1
    if column.numbers.dtype.kind in "iu" and len(column.numbers):
        low, high = int(column.numbers.min()), int(column.numbers.max())
        return column.numbers - low, high - low + 1
    distinct, codes = np.unique(column.numbers, return_inverse=True)
    return codes, max(len(distinct), 1)
