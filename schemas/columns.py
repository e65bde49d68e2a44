"""One analysis of a column of a table, from which all checks of the column are answered."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from schemas.table import Column

if TYPE_CHECKING:
    import pandas as pd

DIFFERENT = 2**62


_NONE = np.zeros(0, dtype=np.intp)


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
        codes, own = _codes_of(column)
        count *= own
        if count > DIFFERENT:
            return False
        combined = combined * own + codes
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
