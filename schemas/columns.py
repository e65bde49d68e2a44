"""What a column of a table may hold: its type, and which values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Hashable

    from numpy.typing import NDArray

Kind = Literal["text", "number", "whole", "flag"]
DTYPES: dict[Kind, str] = {"text": "str", "number": "float64", "whole": "int64", "flag": "bool"}
NEEDED: dict[Kind, str] = {
    "text": "a text", "number": "a finite number", "whole": "a whole number", "flag": "true or false",
}  # fmt: skip


@cache
def _name_of(dtype: Hashable) -> str:
    """The name of a type, which pandas composes anew at each call."""
    return str(dtype)


class WrongValues(NamedTuple):
    """Rows (n,) whose value is not allowed, and what is needed there."""

    rows: NDArray[np.bool_]
    needed: str


@dataclass(frozen=True)
class Column:
    """The contract of a column.

    low : smallest number that is allowed · allowed : the texts that may occur, all if there are none
    empty : whether a text may be empty · missing : whether a value may be missing; an infinite number may be there then, too
    """

    kind: Kind
    low: float | None = None
    allowed: tuple[str, ...] = ()
    empty: bool = False
    missing: bool = False

    def converted(self, values: pd.Series) -> pd.Series | WrongValues:
        """The values in the type of the column, or those that have none in it."""
        if _name_of(values.dtype) == DTYPES[self.kind]:
            return values
        if self.kind == "text":
            return values.astype("str")
        if self.kind == "flag":
            wrong = ~values.isin([True, False]).to_numpy()
            return WrongValues(wrong, NEEDED["flag"]) if wrong.any() else values.astype("bool")
        numbers = pd.to_numeric(values, errors="coerce")
        if self.kind == "whole":
            whole = np.asarray(numbers, dtype=np.float64)
            wrong = ~np.isfinite(whole) | (np.floor(whole) != whole)
            return WrongValues(wrong, NEEDED["whole"]) if wrong.any() else numbers.astype("int64")
        wrong = (numbers.isna() & values.notna()).to_numpy()
        return WrongValues(wrong, NEEDED["number"]) if wrong.any() else numbers.astype("float64")

    def wrong(self, values: pd.Series) -> WrongValues | None:
        """The values of the column's type that are not allowed; None where there are none."""
        return self._wrong_text(values) if self.kind == "text" else self._wrong_number(values)

    def _wrong_text(self, values: pd.Series) -> WrongValues | None:
        there: list[Any] = values.unique().tolist()  # a few texts in many rows
        bad = [text for text in there if not self._is_allowed(text)]
        if not bad:
            return None
        needed = f"one of {', '.join(self.allowed)}" if self.allowed else NEEDED["text"]
        return WrongValues((values.isin(bad) | (values.isna() & (not self.missing))).to_numpy(), needed)

    def _is_allowed(self, text: Any) -> bool:
        if not isinstance(text, str):
            return self.missing
        return text in self.allowed if self.allowed else bool(text) or self.empty

    def _wrong_number(self, values: pd.Series) -> WrongValues | None:
        numbers = values.to_numpy()
        if self.kind == "number" and not self.missing:
            finite = np.isfinite(numbers)
            if not finite.all():
                return WrongValues(~finite, NEEDED["number"])
        if self.low is not None:
            low = numbers < self.low
            if low.any():
                return WrongValues(low, f"at least {self.low:g}")
        return None
