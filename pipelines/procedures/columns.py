"""Tables that procedures write: points, figures and findings, made from rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipelines.tables.frames import empty_table

POINT_TEXTS, POINT_NUMBERS, POINT_WHOLE = "unit procedure axis series", "setting value uncertainty", "number point"
FIGURE_TEXTS, FIGURE_NUMBERS = "unit procedure figure axis unit_text note", "value uncertainty low high dof removed"


def numbers(rows: pd.DataFrame, *names: str) -> list[NDArray[np.float64]]:
    """Columns of points as arrays: setting, value and uncertainty where none is named."""
    return [rows[name].to_numpy(dtype=float) for name in names or ("setting", "value", "uncertainty")]


def point_rows(**columns: Any) -> list[dict[str, Any]]:
    """Rows of points from columns in their order; what is one value, not a sequence, is that of every row."""
    count = max(np.size(one) for one in columns.values())
    spread = {name: [one] * count if np.ndim(one) == 0 else one for name, one in columns.items()}
    return [dict(zip(spread, row, strict=True)) for row in zip(*spread.values(), strict=True)]


def point_table(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Points from rows with unit, axis, series, point, setting, value, uncertainty and further numbers."""
    listed = list(rows)
    if not listed:
        return pd.DataFrame(
            {
                **{name: pd.Series([], dtype="str") for name in ("unit", "axis", "series")},
                "point": pd.Series([], dtype="int64"),
            }
            | {name: pd.Series([], dtype="float64") for name in POINT_NUMBERS.split()}
        )
    return pd.DataFrame(listed)


def gathered_points(parts: Sequence[tuple[int, str, pd.DataFrame]]) -> pd.DataFrame:
    """The table ``procedure_points`` of all procedures of a recipe."""
    frames = [frame.assign(number=number, procedure=name) for number, name, frame in parts if len(frame)]
    if not frames:
        return empty_table(texts=POINT_TEXTS, numbers=POINT_NUMBERS, whole=POINT_WHOLE)
    return pd.concat(frames, ignore_index=True)


def figure_table(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The table ``procedure_figures``."""
    if not rows:
        return empty_table(texts=FIGURE_TEXTS, numbers=FIGURE_NUMBERS, whole="number", flags="identified")
    return pd.DataFrame(list(rows))


def finding_table(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """The table ``procedure_findings``."""
    if not rows:
        return empty_table(texts="unit procedure subject text", whole="number")
    return pd.DataFrame(list(rows))
