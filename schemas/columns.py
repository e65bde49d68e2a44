"""One look at a column of a table: what its values are, so that every question about it is answered from the same look."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Self

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    import pandas as pd
    import pandera.pandas as pa
    from numpy.typing import NDArray

DIFFERENT = 2**62


_NONE = np.zeros(0, dtype=np.intp)


@cache
def _named(kind: Hashable) -> str:
    """The name of a type; the libraries put it together anew whenever they are asked."""
    return str(kind)


@dataclass(frozen=True)
class Seen:
    """A column.

    kind : name of its type; numbers : (rows,), its values where they are numbers or flags, none where they are texts
    codes : (rows,), of the texts, −1 where one is missing; texts : each that occurs, once
    """

    kind: str
    numbers: NDArray[Any] | None
    codes: NDArray[np.intp]
    texts: tuple[object, ...] = ()

    @classmethod
    def of(cls, values: pd.Series) -> Self:
        """What a column holds."""
        if isinstance(values.dtype, np.dtype) and values.dtype.kind in "fiub":
            return cls(_named(values.dtype), values.to_numpy(), _NONE)
        codes, texts = values.factorize()
        return cls(str(values.dtype), None, codes, tuple(texts.tolist()))

    def is_right(self, column: pa.Column) -> bool:
        """Whether the column has its type and passes its checks."""
        kind = _named(column.dtype).split("[", maxsplit=1)[0].replace("string", "str")
        if self.kind != kind or (not column.nullable and self._has_gaps()):
            return False
        return all(self._passes(check) for check in column.checks or [])

    def is_finite(self, rows: slice | NDArray[np.bool_]) -> bool:
        """Whether it holds finite numbers in these rows."""
        return self.numbers is not None and bool(np.all(np.isfinite(self.numbers[rows])))

    def _has_gaps(self) -> bool:
        if self.numbers is None:
            return bool((self.codes < 0).any())
        return self.numbers.dtype.kind == "f" and bool(np.isnan(self.numbers).any())

    def _passes(self, check: pa.Check) -> bool:
        """Whether the values pass a check of one of the kinds that tables here have; any other is left to the schema."""
        figures = check.statistics
        if check.name == "greater_than_or_equal_to" and self.numbers is not None:
            return not bool((self.numbers < figures["min_value"]).any())
        if check.name == "isin" and self.numbers is None:
            return set(self.texts) <= set(figures["allowed_values"])
        if check.name == "str_length" and figures == {"min_value": 1, "max_value": None, "exact_value": None}:
            return "" not in self.texts
        return False


def all_different(columns: Sequence[Seen]) -> bool:
    """Whether no two rows have the same values in all of these columns; no, too, where the values are too many to tell so."""
    together, count = np.zeros(1, dtype=np.int64), 1
    for column in columns:
        codes, own = _numbered(column)
        count *= own
        if count > DIFFERENT:
            return False
        together = together * own + codes
    return not columns or np.unique(together).size == together.size


def _numbered(column: Seen) -> tuple[NDArray[np.int64], int]:
    """A number (rows,) from nought for every value of a column, and how many there are at most."""
    if column.numbers is None:
        return column.codes + 1, len(column.texts) + 1
    if column.numbers.dtype.kind in "iu" and len(column.numbers):
        low, high = int(column.numbers.min()), int(column.numbers.max())
        return column.numbers - low, high - low + 1
    found, codes = np.unique(column.numbers, return_inverse=True)
    return codes, max(len(found), 1)
