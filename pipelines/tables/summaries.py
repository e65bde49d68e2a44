"""One pass over the samples of a run: a row for every unit and record, the input of validation and reduction."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipelines.tables.frames import empty_table
from schemas.units import AXES

Array = NDArray[np.float64]

STATIC, PROCEDURE = "allan", "procedure"
"""Kinds of records that are no dwells."""
MEANS, SPREADS, LOWS, HIGHS = (tuple(f"{name}_{axis}" for axis in AXES) for name in ("out", "sd", "low", "high"))
NUMBERS = " ".join((*MEANS, *SPREADS, *LOWS, *HIGHS, "wild_value"))
OUTLIER_SIGMA = 20.0
OUTLIER_PART = 1e-3  # of the full scale: a smaller outlier changes a mean of a hundred samples by at most 1e-5 of it
FEWEST_FOR_OUTLIERS = 20
WHOLE = "record n wild_count wild_axis wild_row clipped clipped_axis"


def by_record(samples: Iterable[pd.DataFrame]) -> Iterator[tuple[int, Iterator[pd.DataFrame]]]:
    """Number and tables of every record that has samples, each as long as it takes: not all of them lie in memory."""
    yield from groupby((table for table in samples if len(table)), key=lambda t: int(t["record"].iloc[0]))


def summarised(
    samples: Iterable[pd.DataFrame], readings: pd.DataFrame, zero_output: float = 0.0, axes: int = len(AXES)
) -> pd.DataFrame:
    """One row for each record and unit with samples, in the order of the samples.

    Columns: ``unit``, ``record``, ``kind``, ``n``; mean ``out_x`` …, standard deviation ``sd_x`` … (n − 1 in its divisor),
    smallest ``low_x`` … and largest ``high_x`` … sample, in the output's unit; ``wild_count`` values that are not finite, the
    first of them ``wild_value`` on axis ``wild_axis`` (0 to 2) in row ``wild_row``; ``clipped`` values at full scale, the
    first on ``clipped_axis``.

    Parameters
    ----------
    samples : one table per record, or several of a long one; each is read once
    readings : full scale of every unit in every record, where it answered
    zero_output : nominal output at 0 g, from which the full scale extends both ways; output unit
    axes : number of axes with an output; the others have no columns
    """
    full = readings[readings["status"] == "ok"].set_index(["record", "unit"])["full_scale"]
    rows = [
        row
        for record, tables in by_record(samples)
        for row in _of_record(record, tables, full, zero_output, AXES[:axes])
    ]
    return pd.DataFrame(rows) if rows else empty_table(texts="unit kind", numbers=NUMBERS, integers=WHOLE)


def unit_means(table: pd.DataFrame) -> dict[str, Array]:
    """The mean sample (3,) of each unit in one table of a record, the output's unit: the ``out_x`` … of :func:`summarised`."""
    mean = table.groupby("unit", sort=True)[list(AXES)].mean()
    return {str(unit): row for unit, row in zip(mean.index, mean.to_numpy(), strict=True)}


def _of_record(
    record: int, tables: Iterator[pd.DataFrame], full: pd.Series, zero_output: float, letters: Sequence[str]
) -> Iterator[dict[str, Any]]:
    known: dict[str, dict[str, Any]] = {}
    for table in tables:
        for unit, part in _parts(table, record, full, zero_output, letters):
            head = {"unit": unit, "record": record, "kind": str(table["kind"].iloc[0])}
            known[unit] = _joined(known[unit], part) if unit in known else head | part
    for row in known.values():
        flat = {name: value for name, value in row.items() if not isinstance(value, np.ndarray)}
        columns = zip((MEANS, SPREADS, LOWS, HIGHS), ("mean", "sd", "low", "high"), strict=True)
        yield flat | {
            name: float(value) for names, key in columns for name, value in zip(names, row[key], strict=False)
        }


def _parts(
    table: pd.DataFrame, record: int, full: pd.Series, zero_output: float, letters: Sequence[str]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """The rows of one table for each of its units, in order of unit."""
    groups = table.groupby("unit", sort=True)
    values = groups[list(letters)]
    mean, sd, low, high = (
        statistic.to_numpy() for statistic in (values.mean(), values.std(ddof=1), values.min(), values.max())
    )
    output = table[list(letters)].to_numpy(dtype=float)
    for k, (unit, places) in enumerate(groups.indices.items()):
        samples = output[places]
        limit = float(full.get((record, unit), 0.0))
        bad = np.argwhere(~np.isfinite(samples))
        ends = np.argwhere(np.abs(samples - zero_output) >= limit) if limit > 0.0 else bad[:0]
        row, axis = bad[0].tolist() if len(bad) else (0, 0)
        part = {
            "n": len(samples), "mean": mean[k], "sd": sd[k], "low": low[k], "high": high[k],
            "wild_count": len(bad), "wild_row": row, "wild_axis": axis,
            "wild_value": float(samples[row, axis]) if len(bad) else 0.0,
            "clipped": len(ends), "clipped_axis": int(ends[0][1]) if len(ends) else 0,
        }  # fmt: skip
        yield str(unit), part


def _joined(earlier: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    """Merge two parts of a record: Chan, Golub & LeVeque, Amer. Statist. 37 (1983) 242, for mean and variance."""
    n = earlier["n"] + more["n"]
    with np.errstate(all="ignore"):  # values that are not finite stay so, and their unit is refused
        apart = more["mean"] - earlier["mean"]
        squares = apart**2 * (earlier["n"] * more["n"] / n)
        for part in (earlier, more):
            squares = squares + (part["sd"] ** 2 * (part["n"] - 1) if part["n"] > 1 else 0.0)
        mean, sd = earlier["mean"] + apart * (more["n"] / n), np.sqrt(squares / (n - 1))
    first_wild = earlier if earlier["wild_count"] else {**more, "wild_row": more["wild_row"] + earlier["n"]}
    first_clipped = earlier if earlier["clipped"] else more
    return earlier | {
        "n": n,
        "mean": mean,
        "sd": sd,
        "low": np.minimum(earlier["low"], more["low"]),
        "high": np.maximum(earlier["high"], more["high"]),
        "wild_count": earlier["wild_count"] + more["wild_count"],
        **{name: first_wild[name] for name in ("wild_value", "wild_row", "wild_axis")},
        "clipped": earlier["clipped"] + more["clipped"],
        "clipped_axis": first_clipped["clipped_axis"],
    }


class Outlier(NamedTuple):
    """An implausible sample: its row and axis, its value and the median of its record, the output's unit."""

    row: int
    axis: int
    value: float
    median: float


def first_outlier(output: Array, lsb: float, full_scale: float) -> Outlier | None:
    """The first sample too far from the median of the samples (n, 3) of one record; None where none is, or for a small n.

    The spread is half the width of the middle 68 %, which no outlier widens. It takes all samples at once: percentiles of several
    tables do not follow from those of each, so it is no column of :func:`summarised`.

    Parameters
    ----------
    lsb, full_scale : of the output, its unit
    """
    if len(output) < FEWEST_FOR_OUTLIERS:
        return None
    low, middle, high = np.percentile(output, (15.87, 50.0, 84.13), axis=0)
    allowed = np.maximum(OUTLIER_SIGMA * np.maximum(0.5 * (high - low), lsb), OUTLIER_PART * full_scale)
    far = np.argwhere(~(np.abs(output - middle) <= allowed))
    if not len(far):
        return None
    row, axis = far[0].tolist()
    return Outlier(row, axis, float(output[row, axis]), float(middle[axis]))


def means(summaries: pd.DataFrame, kinds_but: Sequence[str] = ()) -> pd.DataFrame:
    """Unit, record and mean samples x, y, z of the axes with an output, without some kinds."""
    rows = summaries[~summaries["kind"].isin(list(kinds_but))]
    names = dict(zip(there(rows, MEANS), AXES, strict=False))
    return rows[["unit", "record", *names]].rename(columns=names)


def there(table: pd.DataFrame, names: Sequence[str]) -> list[str]:
    """The columns of axes that have an output."""
    return [name for name in names if name in table.columns]
