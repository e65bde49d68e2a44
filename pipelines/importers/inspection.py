"""Inspection of a file: its content, its probable meaning, its faults, and the command that imports it."""

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from inertial import change_of_level, record_faults
from inertial.arrays import Array
from inertial.counts import number_of
from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS
from pipelines.importers import values
from pipelines.importers.content import Content, unit_in
from pipelines.importers.documents import ColumnDocument, InspectDocument, IntervalDocument, SampleFaultDocument
from pipelines.importers.exchange import read_dwells
from pipelines.importers.guesses import EXCHANGE, Guess, Guesses, measurable
from pipelines.importers.proposal import serial_of
from pipelines.importers.recognition import Recognition, recognise
from pipelines.importers.stretches import Stops
from pipelines.importers.transfer_columns import PointsLayout, meanings_of_points, transfer_points
from schemas.errors import DataRejected, TumblelineError

_MOST_INTERVALS = 2000
_NO_REST = "no position at rest was found: an import keeps the record, without dwells"
_POSES = (
    "the output in each pose: angles of the table alone are no measurement; to measure there, write them into a recipe, "
    "poses = [[outer, inner], …], and see what they determine"
)
_ROWS = "a row is a dwell: the mean output in one pose, without its samples"
_REFERENCE = re.compile(r"(?:^|[^a-z])(?:ref\w*|input|drive|base|shaker|exciter|std)(?:[^a-z]|$)", re.IGNORECASE)
_SLOWEST_HZ = 200.0
"""Least rate of a dynamic recording: slower ones are of a unit at rest or turned by hand."""
_PULSE = 0.2
"""Part of the time beyond a tenth of the largest excursion, below which a motion is a shock: of a sine it is 0.94, of random
vibration 0.6."""
_BETWEEN = 0.05
"""Part of the samples between the two levels, up to which a drive is a step: of a sine 0.6 are."""


@dataclass(frozen=True)
class Inspection:
    """The result of an inspection: the document, and the record (time in s or samples, output (n, 3)); None without axes."""

    document: InspectDocument
    time: Array | None
    output: Array | None


def inspect(paths: Sequence[Path], *, join: str = "", group: str = "") -> Inspection:
    """The inspection of a recording of one or several files, joined as :func:`pipelines.importers.sources.read` does."""
    seen = recognise(paths, join=join, group=group)
    if seen.is_exchange:
        return Inspection(_of_dwells(paths[0], seen), None, None)
    if len(paths) == 1 and (meanings := meanings_of_points(seen.content.table)):
        return Inspection(_of_points(paths[0], seen, meanings), None, None)
    numbers = seen.content.table.select_dtypes("number").columns
    if {seen.guessed.columns[str(name)].meaning for name in numbers} == {"outer", "inner"}:
        return Inspection(_document(seen, [_POSES], "tumbleline plan RECIPE"), None, None)
    dynamic = None
    if seen.output is None and len(paths) == 1:
        dynamic = _dynamic_guess(paths[0], seen.content, seen.guessed, seen.rate_hz)
    if dynamic is None:
        document = _document(seen, list(seen.open), seen.import_command)
    else:
        document = _document(seen, list(dynamic.open), dynamic.command)
        dynamic.mark(document["columns"])
    return Inspection(document, seen.time, seen.output)


def _document(seen: Recognition, open_: list[str], command: str) -> InspectDocument:
    content, guessed, time, output = seen.content, seen.guessed, seen.time, seen.output
    faults: list[SampleFaultDocument] = []
    if seen.faults is not None and output is not None:  # without a time the numbers of the samples stand for it
        faults = seen.faults.rows(np.arange(len(output), dtype=np.float64) if time is None else time)
    return {
        "files": [str(path) for path in seen.paths],
        "form": seen.source.form,
        "rows": len(content.table),
        "columns": _columns(content, guessed),
        "remarks": [
            *content.remarks,
            *([_NO_REST] if seen.stops is not None and not len(seen.stops.found) else []),
            *([_ROWS] if guessed.dwells and output is not None else []),
        ],
        "time_unit": guessed.time_unit.meaning,
        "time_reason": guessed.time_unit.reason,
        "output_unit": guessed.output.meaning,
        "output_reason": guessed.output.reason,
        "rate_hz": seen.rate_hz,
        "duration_s": float(time[-1] - time[0]) if time is not None and len(time) > 1 else None,
        "gaps": seen.gaps,
        "faults": faults,
        "intervals": [] if output is None or time is None else _intervals(output, time, seen.stops),
        "open": open_,
        "command": command,
    }


def _of_dwells(path: Path, seen: Recognition) -> InspectDocument:
    """The document about a table of dwells in the exchange format, which ``diagnose`` reads as it is, without an import."""
    open_: list[str] = []
    try:
        read_dwells(path)
    except TumblelineError as problem:
        open_ = [str(problem)]
    document = _document(seen, open_, shlex.join(["tumbleline", "diagnose", str(path)]))
    for column in document["columns"]:
        column |= {"resolution": None, "clipped": 0}
    document["remarks"].append(_content_of_dwells(seen.content.table))
    return document


def _of_points(path: Path, seen: Recognition, meanings: Mapping[str, str]) -> InspectDocument:
    """The document about the points of a transfer function: a row is a frequency, there are neither samples nor dwells."""
    columns = {str(name): Guess("", "") for name in seen.content.table.columns}
    columns |= {name: Guess(meaning.replace("_", " "), "its name") for name, meaning in meanings.items()}
    points = Recognition(seen.paths, seen.content, seen.source, Guesses(columns, Guess("", ""), Guess("", "")))
    open_: list[str] = []
    try:
        transfer_points(seen.content, path.name, PointsLayout())
    except DataRejected as problem:
        open_ = [str(problem)]
    words = ["tumbleline", "import", str(path), "--procedure", "sweep", "--units", serial_of(path)]
    document = _document(points, open_, shlex.join(words))
    document["remarks"].append(f"a transfer function: {number_of(len(seen.content.table), 'point')}, a frequency each")
    return document


def _content_of_dwells(table: pd.DataFrame) -> str:
    names = set(table.columns)
    if set(FORCE_COLUMNS) <= names:
        reference = "the force on each axis"
    elif set(ANGLE_COLUMNS) <= names:
        reference = "the angles of the table"
    else:
        reference = "none: only the magnitude of gravity is known"
    units = number_of(int(table["unit"].nunique()), "unit")
    return f"a table of dwells in {EXCHANGE}: {units}, {number_of(len(table), 'dwell')}; reference: {reference}"


def _intervals(output: Array, time: Array, stops: Stops | None) -> list[IntervalDocument]:
    if stops is None:
        return []
    return [
        {
            "start_s": float(time[a] - time[0]),
            "end_s": float(time[b - 1] - time[0]),
            "samples": b - a,
            "mean": output[a:b].mean(axis=0).tolist(),
            "sd": output[a:b].std(axis=0, ddof=1).tolist(),
            "positions": change_of_level.several_levels(output[a:b]) if k in stops.several else 1,
        }
        for k, (a, b) in enumerate(stops.found.spans[:_MOST_INTERVALS])
    ]


def _columns(content: Content, guessed: Guesses) -> list[ColumnDocument]:
    columns: list[ColumnDocument] = []
    for number, (name, guess) in enumerate(guessed.columns.items(), start=1):
        column, is_axis = content.table[name], guess.meaning in {"x", "y", "z"}
        taken = guessed.output if is_axis else guessed.time_unit if guess.meaning == "time" else None
        unit = content.units.get(name, "") or (taken.meaning if taken else "")
        numbers = measurable(column.to_numpy(dtype=np.float64)) if column.dtype.kind in "fiu" else np.zeros(0)
        there = numbers[np.isfinite(numbers)]
        axis = there if is_axis and there.size else None
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


class _DynamicGuess(NamedTuple):
    """The command that imports a dynamic recording, the columns of reference and unit, and what the user has to add."""

    command: str
    reference: str
    output: str
    open: list[str]

    def mark(self, columns: Iterable[ColumnDocument]) -> None:
        """Put the meanings of the two columns into the document of an inspection."""
        meanings = {self.reference: ("reference", "its name"), self.output: ("z", "the column beside the reference")}
        for column in columns:
            column["meaning"], column["reason"] = meanings.get(column["name"], (column["meaning"], column["reason"]))


def _dynamic_guess(path: Path, content: Content, guessed: Guesses, rate_hz: float | None) -> _DynamicGuess | None:
    """The command that may import a file with a time, an output and a column named as a reference; None for other files."""
    if rate_hz is None or rate_hz < _SLOWEST_HZ:
        return None
    other = [name for name, guess in guessed.columns.items() if guess.meaning != "time"]
    free = [name for name in other if content.table[name].dtype.kind in "fi"]
    driven = [name for name in free if _REFERENCE.search(name)]
    if len(free) != 2 or len(driven) != 1:
        return None
    reference = driven[0]
    output = next(name for name in free if name != reference)
    motion = measurable(values.as_numbers(content.table[reference], reference))
    names = list(guessed.columns)
    pairs = [("time", guessed.column("time")), ("reference", reference), ("z", output)]
    mapped = ",".join(f"{what}={names.index(name) + 1}" for what, name in pairs if name)
    units = {name: content.units.get(name, "") or unit_in(name) for name in (output, reference)}
    volts = units[reference] in {"V", "mV"} and _is_step(motion)
    procedure = "step_response" if volts else "shock" if _lasting(motion) < _PULSE else "sweep"
    missing = [(what, name) for what, name in (("output", output), ("reference", reference)) if not units[name]]
    stated = [f"{what}=UNIT" for what, _ in missing]
    if guessed.time_unit.meaning and not content.units.get(guessed.column("time"), ""):
        stated.append(f"time={guessed.time_unit.meaning}")
    words = ["tumbleline", "import", str(path), "--procedure", procedure, "--map", mapped]
    words += ["--unit-of", ",".join(stated)] if stated else []
    open_ = [f"the unit of column '{name}': --unit-of {what}=…" for what, name in missing]
    if procedure == "shock" and units[output] in {"V", "mV"}:
        words += ["--set", "SHOCK.toml"]
        open_.append(f"the scale of column '{output}': a file SHOCK.toml with the line scale = … (output per g)")
    words += ["--units", serial_of(path)]
    return _DynamicGuess(shlex.join(words), reference, output, open_)


def _is_step(wave: Array) -> bool:
    """Whether a drive is at one of two levels in nearly all samples."""
    low, high = np.nanmin(wave), np.nanmax(wave)
    return bool(np.nanmean(np.minimum(wave - low, high - wave) < 0.1 * (high - low)) > 1.0 - _BETWEEN)


def _lasting(wave: Array) -> float:
    """Part of the samples that are further from the median than a tenth of the furthest."""
    apart = np.abs(wave[np.isfinite(wave)] - np.nanmedian(wave))
    return float(np.mean(apart > 0.1 * apart.max())) if apart.size else 1.0
