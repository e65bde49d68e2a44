"""Tables that procedures write: points with the noise of their records, figures and findings, made from rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial.dynamics.stability import ShortNoise
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


EARLIER_SHARE = 0.8  # relative standard deviation of F² from two Allan variances, in points of earlier versions


def noise_columns(noise: ShortNoise) -> dict[str, float]:
    """Numbers of a point: N² per s, F², and the standard deviation of the estimate of F²."""
    return {"white": noise.white, "flicker": noise.flicker, "flicker_error": noise.flicker_error}


def pooled_noise(rows: pd.DataFrame) -> ShortNoise:
    """Noise of one device from all its records in ``rows``: means, each record counting alike."""
    white, flicker = (np.maximum(rows[name].to_numpy(dtype=float), 0.0) for name in ("white", "flicker"))
    known = "flicker_error" in rows  # points of earlier versions have none
    error = rows["flicker_error"].to_numpy(dtype=float) if known else EARLIER_SHARE * flicker
    return ShortNoise(float(white.mean()), float(flicker.mean()), float(np.sqrt(np.sum(error**2)) / len(rows)))
