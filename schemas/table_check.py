"""The check of a table against its contract: the table with the right types, or one message with row, value and requirement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from schemas.columns import Column, WrongValues
from schemas.errors import DataRejected
from schemas.tables import TABLES

if TYPE_CHECKING:
    import pandas as pd

    from schemas.tables import Table

FINITE = Column("number")


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
    converted: dict[str, pd.Series] = {}
    for column, contract in table.columns.items():
        own = frame[column]
        values = _right(contract, own, frame, source)
        if values is not own:
            converted[column] = values
    counted = (frame["status"] == "ok").to_numpy() if table.only_ok and table.finite else None
    for column in table.finite:
        if column in frame.columns:
            own = frame[column]
            _right(FINITE, own if counted is None or counted.all() else own[counted], frame, source)
    _refuse_twice(table, frame, source)
    return frame.assign(**converted) if converted else frame


def _right(contract: Column, own: pd.Series, frame: pd.DataFrame, source: str) -> pd.Series:
    """The values of a column in its type; the first one that is not allowed is refused."""
    values = contract.converted(own)
    if isinstance(values, WrongValues):
        wrong, needed = values
    else:
        problem = contract.wrong(values)
        if problem is None:
            return values
        wrong, needed = problem
    index = own.index[int(np.flatnonzero(wrong)[0])]
    count = f" ({int(wrong.sum())} such rows)" if wrong.sum() > 1 else ""
    raise DataRejected(
        f"{source}: {_row(frame, index)}, column {own.name}: found {own.loc[index]}, {needed} is needed{count}; "
        "measure again, or correct or leave out the row"
    )


def _refuse_missing_columns(table: Table, frame: pd.DataFrame, source: str) -> None:
    missing = [column for column in table.columns if column not in frame.columns]
    if missing:
        found = ", ".join(map(str, frame.columns)) or "none"
        raise DataRejected(
            f"{source}: column {', '.join(missing)} is missing, found {found}; add it, or map it to its name"
        )


def _refuse_twice(table: Table, frame: pd.DataFrame, source: str) -> None:
    if not table.key:
        return
    twice = frame[list(table.key)].duplicated()
    if twice.any():
        index = frame.index[int(np.flatnonzero(twice.to_numpy())[0])]
        named = ", ".join(f"{column} {frame[column].loc[index]}" for column in table.key)
        raise DataRejected(
            f"{source}: row {index}: {named} is there twice, it may be there once; remove one of the two"
        )


def _row(frame: pd.DataFrame, index: Any) -> str:
    unit = f" (unit {frame['unit'].loc[index]})" if "unit" in frame.columns else ""
    return f"row {index}{unit}"
