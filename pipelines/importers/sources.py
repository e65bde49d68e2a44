"""One recording from several files: one after another, or side by side."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from pipelines.importers import clocks, files, values
from pipelines.importers.content import Content
from pipelines.importers.stated_units import column_name
from schemas.errors import DataRejected, WrongUse
from schemas.foreign import shown


def read(
    paths: Sequence[Path], *, join: str = "", time: str = "", group: str = ""
) -> tuple[Content, files.SourceFile, tuple[int, ...]]:
    """A recording, its source, and the rows before which another file begins.

    Parameters
    ----------
    join : ``rows``: the files follow one another; ``columns``: they are side by side.
    time : the column of time, by name or number; empty if not mapped.
    group : the group of channels of each file with several.

    Raises
    ------
    DataRejected
        The files do not fit together.
    """
    if len(paths) == 1:
        return (*files.read_content(paths[0], group), ())
    contents, sources = zip(*(files.read_content(path, group) for path in paths), strict=True)
    names = [path.name for path in paths]
    if join == "columns":
        joined, breaks = _beside(contents, names, time), ()
    else:
        joined, breaks = _after(contents, names, time)
    paths_joined, size = " + ".join(source.path for source in sources), sum(source.size for source in sources)
    about = files.SourceFile(paths_joined, files.digest_of(sources), size, sources[0].form, sources)
    return joined, about, breaks


def _after(contents: Sequence[Content], names: list[str], time: str) -> tuple[Content, tuple[int, ...]]:
    """Files one after another; a clock that restarts is continued after the file before."""
    first = contents[0]
    columns = list(first.table.columns)
    tables, breaks, remarks = [first.table], [0], list(first.remarks)
    for content, name in zip(contents[1:], names[1:], strict=True):
        if list(content.table.columns) != columns:
            raise DataRejected(
                f"{name}: its columns ({shown(', '.join(content.table.columns))}) are not those of {names[0]} "
                f"({shown(', '.join(columns))}), the same are needed; join files side by side with --set join=columns"
            )
        breaks.append(breaks[-1] + len(tables[-1]))
        label = column_name(columns, time)
        table, shifted = _behind(tables[-1], content.table, label)
        if shifted:
            remarks.append(f"{name}: its clock restarts; it is continued after {names[len(tables) - 1]}")
        tables.append(table)
    numbered = all(content.lines for content in contents)
    lines = tuple(part for content in contents for part in content.lines) if numbered else ()
    words = {
        name: [word for each in contents for word in each.named(name).tolist()]
        for content in contents
        for name in content.words
    }
    table = pd.concat(tables, ignore_index=True)
    return replace(first, table=table, remarks=tuple(remarks), lines=lines, words=words), tuple(breaks[1:])


def _behind(before: pd.DataFrame, table: pd.DataFrame, time: str) -> tuple[pd.DataFrame, bool]:
    """A table whose clock continues that of the table before, and whether it was shifted."""
    if not time or before[time].dtype.kind not in "fiu" or table[time].dtype.kind not in "fiu":
        return table, False
    last, begin = float(before[time].iloc[-1]), float(table[time].iloc[0])
    if not begin <= last:
        return table, False
    step = clocks.typical_step(before[time].to_numpy(dtype=np.float64))
    return table.assign(**{time: table[time] + (last - begin + step)}), True


def _beside(contents: Sequence[Content], names: list[str], time: str) -> Content:
    """Files side by side: by their clocks if both have the column of time, else row by row."""
    first = contents[0]
    columns: dict[str, Any] = {str(name): column for name, column in first.table.items()}
    units, remarks = dict(first.units), list(first.remarks)
    label = column_name(list(columns), time)
    for number, (content, name) in enumerate(zip(contents[1:], names[1:], strict=True), start=2):
        clocked = label and label in content.table.columns
        if not clocked and len(content.table) != len(first.table):
            raise WrongUse(
                f"{name}: {len(content.table)} rows and no column '{shown(label or time or 'time')}', {names[0]} has "
                f"{len(first.table)} rows; rows in equal number, or a common column of time mapped as time=…, are needed"
            )
        for column, data in content.table.items():
            if clocked and column == label:
                continue
            heading = str(column) if str(column) not in columns else f"{number}:{column}"
            columns[heading] = _at(first.table[label], content.table[label], data, name) if clocked else data
            units |= {heading: content.units[str(column)]} if str(column) in content.units else {}
        how = f"read at the times of {names[0]}, linear in between" if clocked else "row by row"
        remarks += [*content.remarks, f"columns of {name} {how}"]
    return replace(first, table=pd.DataFrame(columns), units=units, remarks=tuple(remarks), lines=())


def _at(times: pd.Series, clock: pd.Series, data: pd.Series, where: str) -> Array:
    """A column read at other times; NaN outside its own times."""
    at, given = _instants(times, where), _instants(clock, where)
    if np.any(np.diff(given) < 0.0):
        raise DataRejected(f"{where}: time runs back, it must not; sort the rows")
    numbers = values.as_numbers(data, where)
    inside = np.interp(at, given, numbers)
    slack = 2.0 * clocks.typical_step(given)  # the last reading of a slow channel is valid until the next is due
    return np.where((at < given[0] - slack) | (at > given[-1] + slack), np.nan, inside)


def _instants(column: pd.Series, where: str) -> Array:
    """Numbers that grow with time and are equal for the same instant in every file."""
    if column.dtype.kind in "fiu":
        return column.to_numpy(dtype=np.float64)
    moments = pd.to_datetime(column, format="ISO8601", utc=True, errors="coerce")
    if moments.isna().any():
        raise DataRejected(
            f"{where}: column '{shown(str(column.name))}': numbers or ISO 8601 stamps are needed to put files side by side"
        )
    return np.asarray((moments - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1), dtype=np.float64)
