"""Inspection of a file: its content, its probable meaning, its faults, and the command that imports it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial import change_of_level, record_faults
from inertial.counts import number_of
from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS
from pipelines.importers.content import Content
from pipelines.importers.documents import ColumnDocument, InspectDocument, IntervalDocument
from pipelines.importers.dynamic_guess import dynamic_guess
from pipelines.importers.exchange import read_dwells
from pipelines.importers.guesses import EXCHANGE, Guesses, measurable
from pipelines.importers.recognition import Recognition, recognise
from pipelines.importers.stretches import Stops
from schemas.errors import TumblelineError

_MOST_INTERVALS = 2000


@dataclass(frozen=True)
class Inspection:
    """The result of an inspection: the document, and the record (time in s or samples, output (n, 3)); None without axes."""

    document: InspectDocument
    time: NDArray[np.float64] | None
    output: NDArray[np.float64] | None


def inspect(paths: Sequence[Path], *, join: str = "", group: str = "") -> Inspection:
    """The inspection of a recording of one or several files.

    Parameters
    ----------
    join : how several files are joined, ``rows`` or ``columns``.
    group : the group of channels, if a file has several.
    """
    seen = recognise(paths, join=join, group=group)
    if seen.is_exchange:
        return Inspection(_of_dwells(paths[0], seen), None, None)
    time, output, open_ = seen.time, seen.output, list(seen.open)
    dynamic = (
        dynamic_guess(paths[0], seen.content, seen.guessed, seen.rate_hz)
        if output is None and len(paths) == 1
        else None
    )
    if dynamic is not None:
        open_ = list(dynamic.open)
    document: InspectDocument = {
        **_document(seen),
        "rate_hz": seen.rate_hz,
        "duration_s": float(time[-1] - time[0]) if time is not None and len(time) > 1 else None,
        "gaps": seen.gaps,
        "faults": [] if seen.faults is None or output is None else seen.faults.rows(_clock_of(output, time)),
        "intervals": [] if output is None or time is None else _intervals(output, time, seen.stops),
        "open": open_,
        "command": seen.import_command if dynamic is None else dynamic.command,
    }
    if dynamic is not None:
        dynamic.mark(document["columns"])
    return Inspection(document, time, output)


def _document(seen: Recognition) -> InspectDocument:
    """The document with what is known of the columns, and nothing of a record in them."""
    content, guessed = seen.content, seen.guessed
    return {
        "files": [str(path) for path in seen.paths],
        "form": seen.source.form,
        "rows": len(content.table),
        "columns": _columns(content, guessed),
        "remarks": list(content.remarks),
        "time_unit": guessed.time_unit.meaning,
        "time_reason": guessed.time_unit.reason,
        "output_unit": guessed.output.meaning,
        "output_reason": guessed.output.reason,
        "rate_hz": None,
        "duration_s": None,
        "gaps": 0,
        "faults": [],
        "intervals": [],
        "open": [],
        "command": "",
    }


def _of_dwells(path: Path, seen: Recognition) -> InspectDocument:
    """The document about a table of dwells in the exchange format, which ``diagnose`` reads as it is, without an import."""
    document = _document(seen)
    for column in document["columns"]:
        column |= {"resolution": None, "clipped": 0}
    document["remarks"].append(_content_of_dwells(seen.content.table))
    document["command"] = shlex.join(["tumbleline", "diagnose", str(path)])
    try:
        read_dwells(path)
    except TumblelineError as problem:
        document["open"] = [str(problem)]
    return document


def _content_of_dwells(table: pd.DataFrame) -> str:
    """What the table holds, as a sentence."""
    names = set(table.columns)
    if set(FORCE_COLUMNS) <= names:
        reference = "the force on each axis"
    elif set(ANGLE_COLUMNS) <= names:
        reference = "the angles of the table"
    else:
        reference = "none: only the magnitude of gravity is known"
    units = number_of(int(table["unit"].nunique()), "unit")
    return f"a table of dwells in {EXCHANGE}: {units}, {number_of(len(table), 'dwell')}; reference: {reference}"


def _clock_of(output: NDArray[np.float64], time: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Seconds, or the numbers of the samples if there is no time."""
    return np.arange(len(output), dtype=np.float64) if time is None else time


def _intervals(output: NDArray[np.float64], time: NDArray[np.float64], stops: Stops | None) -> list[IntervalDocument]:
    if stops is None:
        return []
    pairs = list(zip(stops.found.first, stops.found.last, strict=True))[:_MOST_INTERVALS]
    return [
        {
            "start_s": float(time[a] - time[0]),
            "end_s": float(time[b - 1] - time[0]),
            "samples": b - a,
            "mean": output[a:b].mean(axis=0).tolist(),
            "sd": output[a:b].std(axis=0, ddof=1).tolist(),
            "positions": change_of_level.several_levels(output[a:b]) if k in stops.several else 1,
        }
        for k, (a, b) in enumerate(pairs)
    ]


def _columns(content: Content, guessed: Guesses) -> list[ColumnDocument]:
    columns: list[ColumnDocument] = []
    for number, (name, guess) in enumerate(guessed.columns.items(), start=1):
        column = content.table[name]
        unit = content.units.get(name, "")
        if guess.meaning in {"x", "y", "z"}:
            unit = unit or guessed.output.meaning
        elif guess.meaning == "time":
            unit = unit or guessed.time_unit.meaning
        numbers = measurable(column.to_numpy(dtype=np.float64)) if column.dtype.kind in "fiu" else np.zeros(0)
        there = numbers[np.isfinite(numbers)]
        axis = there if guess.meaning in {"x", "y", "z"} and there.size else None
        columns.append(
            {
                "name": name,
                "number": number,
                "meaning": guess.meaning,
                "reason": guess.reason,
                "unit": unit,
                "missing": int(column.isna().sum()) if not numbers.size else int(numbers.size - there.size),
                "low": float(there.min()) if there.size else None,
                "high": float(there.max()) if there.size else None,
                "resolution": None if axis is None else record_faults.resolution(axis),
                "clipped": 0 if axis is None else record_faults.clipped(axis)[2],
            }
        )
    return columns
