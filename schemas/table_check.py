"""The check of a table against its contract: the table with the right types, or one message with row, value and requirement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from schemas.columns import Seen, all_different
from schemas.errors import DataRejected
from schemas.tables import TABLES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from schemas.table import Column, Table

EXACT = 2**53
"""Whole numbers up to it are exact as floating-point numbers."""


def check(name: str, frame: pd.DataFrame, *, where: str = "") -> pd.DataFrame:
    """The frame with its columns converted to the right types, or :class:`DataRejected`.

    Parameters
    ----------
    name : a key of :data:`TABLES`.
    where : name of the table's source in a message; the table's name by default.
    """
    table = TABLES[name]
    source = where or name
    _refuse_missing_columns(table, frame, source)
    if _plainly_right(table, frame):
        return frame
    _refuse_not_finite(table, frame, source)
    _refuse_twice(table, frame, source)
    return _converted(table, frame, source)


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
        own = rows[column]
        plain = own.dtype == np.float64  # others are converted first, which is slower
        values = own.to_numpy() if plain else np.asarray(pd.to_numeric(own, errors="coerce"), dtype=float)
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
            f"{source}: row {index}: {named} is there twice, it may be there once; remove one of the two"
        )


def _converted(table: Table, frame: pd.DataFrame, source: str) -> pd.DataFrame:
    """The frame with the types of its contract; refuses the first value that has no place in its column."""
    right: dict[str, Any] = {}
    for name, column in table.columns.items():
        values, wrong = _texts(frame[name], column) if column.kind == "str" else _numbers(frame[name], column)
        if wrong.any():
            first = int(np.flatnonzero(wrong)[0])
            found = frame[name].iloc[first]
            raise DataRejected(
                f"{source}: {_row(frame, frame.index[first])}, column {name}: found {'nothing' if found == '' else found}, "
                f"{column.needed} is needed; correct the row"
            )
        right[name] = values.astype(column.kind)
    return frame.assign(**right)


def _texts(values: pd.Series, column: Column) -> tuple[pd.Series, NDArray[np.bool_]]:
    """A column as texts, and which of them are wrong."""
    texts = values.astype("str")
    wrong = values.isna().to_numpy()
    if column.allowed:
        wrong = wrong | ~texts.isin(column.allowed).to_numpy()
    return texts, wrong | (texts == "").to_numpy() if column.filled else wrong


def _numbers(values: pd.Series, column: Column) -> tuple[pd.Series, NDArray[np.bool_]]:
    """A column of numbers or flags, and which of them are wrong."""
    if not pd.api.types.is_numeric_dtype(values):
        values = values.astype("object")
    found = pd.to_numeric(values, errors="coerce")
    numbers = found.to_numpy(dtype=float, na_value=np.nan)
    wrong = np.isnan(numbers) & ~(values.isna().to_numpy() & column.missing)
    if column.low is not None:
        wrong |= numbers < column.low
    if column.kind == "bool":
        wrong |= ~np.isin(numbers, (0.0, 1.0))
    if column.kind == "int64" and not pd.api.types.is_integer_dtype(found):
        wrong |= ~np.isfinite(numbers) | (numbers != np.round(numbers)) | (np.abs(numbers) > EXACT)
    return pd.Series(numbers, index=values.index) if column.kind == "float64" else found, wrong


def _row(frame: pd.DataFrame, index: Any) -> str:
    unit = f" (unit {frame['unit'].loc[index]})" if "unit" in frame.columns else ""
    return f"row {index}{unit}"
