"""Inspection of a file: its content, its probable meaning, its faults, and the command that imports it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial import change_of_level, record_faults, static_intervals
from inertial.counts import number_of
from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS
from pipelines.importers import clocks, files, sample_faults, sources, unit_check, values
from pipelines.importers.content import Content
from pipelines.importers.documents import ColumnDocument, InspectDocument, IntervalDocument
from pipelines.importers.dynamic_guess import dynamic_guess, serial_of
from pipelines.importers.exchange import is_exchange, read_dwells
from pipelines.importers.guesses import EXCHANGE, Guesses, guesses, guesses_of_dwells, measurable
from pipelines.importers.mapping import TIME_UNITS
from pipelines.importers.record_time import GAP
from pipelines.importers.stated_units import TEMPERATURE
from schemas.errors import TumblelineError
from schemas.units import AXES

_NAMED = ("time", "x", "y", "z", "sd_x", "sd_y", "sd_z", "n", "force_x", "tilt", "temperature", "dwell")
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
    first, _ = files.read_content(paths[0], group)
    time_name = guesses(first).column("time") if len(paths) > 1 else ""
    content, source, _ = sources.read(paths, join=join, time=time_name, group=group)
    if len(paths) == 1 and is_exchange(content.table.columns):
        return Inspection(_of_dwells(paths[0], content, source.form), None, None)
    guessed = guesses(content)
    time, gaps, open_ = _time(content, guessed)
    output = _output(content, guessed)
    whole = np.ones(len(content.table), dtype=bool) if output is None else np.isfinite(output).all(axis=1)
    if time is not None:
        whole &= np.isfinite(time)
    kept = None if output is None else output[whole]
    own = None if time is None else time[whole]
    faults = sample_faults.look(kept) if kept is not None and len(kept) > 3 and not guessed.dwells else None
    rate = _rate(own)
    intervals = _intervals(kept, own, rate) if kept is not None and rate else []
    dynamic = dynamic_guess(paths[0], content, guessed, rate) if output is None and len(paths) == 1 else None
    if dynamic is not None:
        open_ += dynamic.open
    elif output is None and not guessed.single:
        missing = [axis for axis in "xyz" if not guessed.column(axis)]
        open_.append(f"columns of acceleration were not recognised: map {' and '.join(missing)} by name or number")
        few = len([one for one in guessed.columns.values() if one.meaning != "time"])
        if few < len(AXES):
            open_.append(
                f"{few} column{'s' if few > 1 else ''} beside the time: an import needs three axes; a record at rest of fewer "
                "has its noise by 'tumbleline allan' and 'tumbleline psd'"
            )
    bits = 0 if output is None else unit_check.unsigned_bits(output[np.isfinite(output).all(axis=1)])
    if bits:
        open_.append(
            f"signed words of {bits} bits were read without their sign: subtract {2**bits} from {2 ** (bits - 1)} on"
        )
    if guessed.output.meaning == "" and (output is not None or guessed.single):
        open_.append("the unit of the output: --units output=g|mg|m/s^2|V|mV|LSB")
    positions = (
        change_of_level.several_levels(kept)
        if kept is not None and any(one["positions"] > 1 for one in intervals)
        else 0
    )
    split = bool(gaps) or not bool(whole.all())
    document: InspectDocument = {
        **_document(paths, content, source.form, guessed),
        "rate_hz": rate,
        "duration_s": float(own[-1] - own[0]) if own is not None and len(own) > 1 else None,
        "gaps": gaps,
        "faults": [] if faults is None or kept is None else faults.rows(_clock_of(kept, own)),
        "intervals": intervals,
        "open": open_,
        "command": dynamic.command
        if dynamic is not None
        else _command(
            paths, content, guessed, join=join, group=group, split=split, faulty=bool(faults), positions=positions
        ),
    }
    if dynamic is not None:
        dynamic.mark(document["columns"])
    return Inspection(document, own, kept)


def _document(paths: Sequence[Path], content: Content, form: str, guessed: Guesses) -> InspectDocument:
    """The document with what is known of the columns, and nothing of a record in them."""
    return {
        "files": [str(path) for path in paths],
        "form": form,
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


def _of_dwells(path: Path, content: Content, form: str) -> InspectDocument:
    """The document about a table of dwells in the exchange format, which ``diagnose`` reads as it is, without an import."""
    document = _document([path], content, form, guesses_of_dwells(content.table))
    for column in document["columns"]:
        column |= {"resolution": None, "clipped": 0}
    document["remarks"].append(_content_of_dwells(content.table))
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


def _time(content: Content, guessed: Guesses) -> tuple[NDArray[np.float64] | None, int, list[str]]:
    """Seconds of every row, count of gaps, and missing options."""
    name = guessed.column("time")
    if not name and guessed.dwells:
        return None, 0, []
    if not name:
        return (
            None,
            0,
            ["the rate of the samples: no column of time was recognised and the file states no interval; --rate HZ"],
        )
    column = content.table[name]
    open_: list[str] = []
    if values.is_moment(column):
        time = values.seconds(column.ffill(), name)
    elif clocks.is_stamps(column):
        time = clocks.stamps(column.ffill().bfill(), name)
    else:
        numbers = measurable(np.asarray(values.as_numbers(column, name), dtype=np.float64))
        unit = guessed.time_unit.meaning
        if not unit:
            open_.append(
                f"the unit of time: {guessed.time_unit.reason}; --units time=s|ms|us|ns, or time=samples and --rate HZ"
            )
        first = numbers[np.isfinite(numbers)][0] if np.any(np.isfinite(numbers)) else 0.0
        time = (numbers - first) * TIME_UNITS.get(unit, 1.0)
    steps = np.diff(time[np.isfinite(time)])
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    if np.any(steps < 0.0) and not guessed.column("dwell"):
        open_.append(
            f"time runs back at row {int(np.flatnonzero(steps < 0.0)[0]) + 2}: sort the rows, or divide the file"
        )
    return time, int(np.count_nonzero(steps > GAP * usual)), open_


def _clock_of(output: NDArray[np.float64], time: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Seconds, or the numbers of the samples if there is no time."""
    return np.arange(len(output), dtype=np.float64) if time is None else time


def _rate(time: NDArray[np.float64] | None) -> float | None:
    if time is None or len(time) < 2:
        return None
    step = clocks.typical_step(time)
    return 1.0 / step if step > 0.0 else None


def _output(content: Content, guessed: Guesses) -> NDArray[np.float64] | None:
    names = [guessed.column(axis) for axis in "xyz"]
    if not all(names):
        return None
    return np.column_stack([measurable(values.as_numbers(content.table[name], name)) for name in names])


def _intervals(output: NDArray[np.float64], time: NDArray[np.float64] | None, rate: float) -> list[IntervalDocument]:
    if time is None or len(output) < 3 * max(3, round(rate)) or not np.isfinite(rate):
        return []
    intervals = static_intervals.find(output, rate)
    pairs = list(zip(intervals.start.tolist(), intervals.stop.tolist(), strict=True))[:_MOST_INTERVALS]
    return [
        {
            "start_s": float(time[a] - time[0]),
            "end_s": float(time[b - 1] - time[0]),
            "samples": b - a,
            "mean": output[a:b].mean(axis=0).tolist(),
            "sd": output[a:b].std(axis=0, ddof=1).tolist(),
            "positions": change_of_level.several_levels(output[a:b]),
        }
        for a, b in pairs
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


def _command(
    paths: Sequence[Path],
    content: Content,
    guessed: Guesses,
    *,
    join: str,
    group: str,
    split: bool,
    faulty: bool,
    positions: int,
) -> str:
    """The import command that is proposed; values that the file does not state are in capitals."""
    names = list(guessed.columns)
    pairs = [(meaning, guessed.column(meaning)) for meaning in _NAMED if guessed.column(meaning)]
    words = [f"{meaning}={_mapped(name, names)}" for meaning, name in pairs]
    words += [f"{axis}=COLUMN" for axis in "xyz" if not guessed.column(axis) and not guessed.single]
    mapped = ",".join(words)
    units = [f"output={guessed.output.meaning or 'UNIT'}"]
    time = guessed.column("time")
    if time and guessed.time_unit.meaning:
        units.append(f"time={guessed.time_unit.meaning}")
    elif time and content.table[time].dtype.kind in "fiu":
        units.append("time=UNIT")
    heat = TEMPERATURE.get(content.units.get(guessed.column("temperature"), "").strip().lower(), "degC")
    units += [f"temperature={heat}"] if heat != "degC" else []
    words = ["tumbleline", "import", *(str(path) for path in paths), "--map", mapped, "--units", ",".join(units)]
    words += ["--unit", serial_of(paths[0])]
    words += ["--axes", "x"] if guessed.single else []
    words += ["--rows", "dwells"] if guessed.dwells else [] if time else ["--rate", "HZ"]
    words += ["--join", join] if join else []
    words += ["--group", group] if group else []
    words += ["--gaps", "split"] if split else []
    words += ["--faulty", "leave-out"] if faulty else []
    words += ["--positions", str(positions)] if positions > 1 else []
    return shlex.join(words)


def _mapped(name: str, names: list[str]) -> str:
    """A column as a name for --map: by its number where its name has a comma or an equals sign, or blanks at its ends."""
    return str(names.index(name) + 1) if re.search(r"[,=]|^\s|\s$", name) or not name else name
