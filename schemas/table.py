"""The contract of one table, and the columns that it is made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import pandera.pandas as pa

Kind = Literal["str", "float64", "int64", "bool"]
"""The types of columns, by pandas' names."""


@dataclass(frozen=True)
class Column:
    """What every value of a column must satisfy.

    kind : type; low : smallest number, None for any; allowed : the texts that may be there, none for any
    filled : whether a text may not be empty; missing : whether numbers may be NaN
    """

    kind: Kind
    low: float | None = None
    allowed: tuple[str, ...] = ()
    filled: bool = False
    missing: bool = False

    def contract(self) -> pa.Column:
        """The same as a column of the library that explains what is wrong."""
        import pandera.pandas as pa  # noqa: PLC0415 - a table without an error does not need it

        checks = [pa.Check.ge(self.low)] if self.low is not None else []
        checks += [pa.Check.isin(list(self.allowed))] if self.allowed else []
        checks += [pa.Check.str_length(min_value=1)] if self.filled else []
        return pa.Column(str if self.kind == "str" else self.kind, checks=checks, nullable=self.missing)


@dataclass(frozen=True)
class Table:
    """The contract of one table.

    Parameters
    ----------
    columns : the columns that must be there, with what their values must satisfy.
    measured : columns of numbers that need not be there, or may have gaps in rows that do not count.
    key : columns that together name a row; no two rows may share them.
    only_ok : numbers count only in rows whose ``status`` is ``ok``.
    """

    columns: dict[str, Column]
    measured: tuple[str, ...] = ()
    key: tuple[str, ...] = ()
    only_ok: bool = False

    @cached_property
    def finite(self) -> tuple[str, ...]:
        """Columns of numbers in which NaN and infinity are refused."""
        needed = (name for name, c in self.columns.items() if c.kind == "float64" and not c.missing)
        return (*needed, *self.measured)

    @cached_property
    def schema(self) -> pa.DataFrameSchema:
        """The contract for the library that explains what is wrong."""
        import pandera.pandas as pa  # noqa: PLC0415 - a table without an error does not need it

        return pa.DataFrameSchema(
            {name: column.contract() for name, column in self.columns.items()}, strict=False, coerce=True
        )


def each(column: Column, *names: str) -> dict[str, Column]:
    """The same column under several names."""
    return dict.fromkeys(names, column)


def text(*allowed: str) -> Column:
    """A text: one of the allowed ones, or any that is not empty."""
    return Column("str", allowed=allowed, filled=not allowed)


ANY_TEXT = Column("str")
"""A text that may be empty."""
FLAG = Column("bool")
NUMBER = Column("float64")
"""A number that is not missing."""
GAPS = Column("float64", missing=True)
"""A number that may be NaN."""
WHOLE = Column("int64", low=0)
