"""Rows of a table as dictionaries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd


def rows_of(table: pd.DataFrame) -> list[dict[str, Any]]:
    """One dictionary per row, by column name."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]
