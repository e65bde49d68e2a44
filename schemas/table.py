"""The contract of one table, and the columns that it is made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pandera.pandas as pa

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class Table:
    """The contract of one table.

    Parameters
    ----------
    columns : the columns that must be there, with their checks.
    finite : columns in which NaN and infinity are refused; all of them are numbers.
    key : columns that together name a row; no two rows may share them.
    only_ok : finite columns count only in rows whose ``status`` is ``ok``.
    """

    columns: dict[str, pa.Column]
    finite: tuple[str, ...] = ()
    key: tuple[str, ...] = ()
    only_ok: bool = False
    schema: pa.DataFrameSchema = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "schema", pa.DataFrameSchema(self.columns, strict=False, coerce=True))


def text(*allowed: str) -> pa.Column:
    """A text: one of the allowed ones, or any that is not empty."""
    checks = [pa.Check.isin(list(allowed))] if allowed else [pa.Check.str_length(min_value=1)]
    return pa.Column(str, checks=checks)


def number(*, low: float | None = None, missing: bool = False) -> pa.Column:
    """A floating-point number, at least ``low`` where it is given; NaN only where ``missing``."""
    return pa.Column(float, checks=[pa.Check.ge(low)] if low is not None else [], nullable=missing)


def whole(low: int = 0) -> pa.Column:
    """A whole number, at least ``low``."""
    return pa.Column("int64", checks=[pa.Check.ge(low)])


def numbers(names: Sequence[str]) -> dict[str, pa.Column]:
    """Columns of numbers of which none is missing, by name."""
    return {name: number() for name in names}


def gaps(names: Sequence[str]) -> dict[str, pa.Column]:
    """Columns of numbers that may be NaN, by name."""
    return {name: number(missing=True) for name in names}
