"""Guesses of the meaning of the columns of an unknown file, with reasons: proposals for the user, never used by an import."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS, KNOWN_COLUMNS, LARGEST, SPREAD_COLUMNS
from pipelines.importers import clocks, unit_check, values
from pipelines.importers.clocks import typical_step
from pipelines.importers.content import Content
from pipelines.importers.stated_units import TEMPERATURE, output_unit

_TIME = re.compile(r"time|stamp|elapsed|epoch|zeit|^t$|^ts$|^t[_ \[(]|sec(ond)?s?\b|x_value|date|clock", re.IGNORECASE)
_COUNT = re.compile(r"sample|index|count|number|^n$|^#|window|row", re.IGNORECASE)
_ACCELERATION = re.compile(r"acc|^a[_ .]?[xyz]|^[xyz]$|force|^channel|g[_ ]?[xyz]\b", re.IGNORECASE)
_OTHER = re.compile(r"gyr|rot|omega|mag|quat|angle|roll|pitch|yaw|^sd|std|var|error|lux|uv|press", re.IGNORECASE)
_AXIS = re.compile(r"(?:^|[^a-z])(?:acc\w*?|a|mean|out|force|channel)?[_ .\[(-]*([xyz])(?:[^a-z]|$)", re.IGNORECASE)
_SPREAD = re.compile(r"^(?:sd|std|sigma|s)[_ .]*(?:acc\w*?|a|out)?[_ .]*([xyz])$", re.IGNORECASE)
_FASTEST_K_S = 2.0
"""Rate of temperature that no chamber reaches."""
_HEAT = re.compile(r"temp|heat|^t_?c$|degc|°c", re.IGNORECASE)
_MOST_COLUMNS = 24
_SOME = 20_000
_MOST_POSITIONS = 500
_LIKELY_HZ = 100.0
EXCHANGE = "the exchange format"
_OF_EXCHANGE = {
    "unit": "unit",
    "dwell": "dwell",
    "time_s": "time",
    "out_x": "x",
    "out_y": "y",
    "out_z": "z",
    **dict.fromkeys(FORCE_COLUMNS, "reference force"),
    **dict.fromkeys(ANGLE_COLUMNS, "reference angle"),
    **{name: f"sd_{name[-1]}" for name in SPREAD_COLUMNS},
}


@dataclass(frozen=True)
class Guess:
    """A meaning (time, x, temperature, …; empty if unknown), and the reason."""

    meaning: str
    reason: str


@dataclass(frozen=True)
class Guesses:
    """Guesses of a file.

    columns : column → guess · time_unit, output : units with their reasons; empty if unknown · sheet : whether each row has a
    label of its own, as in a sheet of positions
    """

    columns: dict[str, Guess]
    time_unit: Guess
    output: Guess
    sheet: bool = False

    @property
    def dwells(self) -> bool:
        """Whether rows look like dwells: standard deviations beside the means, or a label of its own in each row."""
        return self.sheet or bool(self.single) or all(self.column(f"sd_{axis}") for axis in "xyz")

    @property
    def single(self) -> str:
        """The output of a table of a device with one axis: it has its reference beside it, a force or an angle; else empty."""
        return self.column("x") if self.column("force_x") or self.column("tilt") else ""

    def column(self, meaning: str) -> str:
        """The column with a meaning; empty if there is none."""
        return _column(self.columns, meaning)


def _column(guessed: dict[str, Guess], meaning: str) -> str:
    return next((name for name, guess in guessed.items() if guess.meaning == meaning), "")


def guesses(content: Content) -> Guesses:
    """Guesses of what the columns of a file mean, by names, units and numbers."""
    table = content.table
    guessed: dict[str, Guess] = {str(name): Guess("", "") for name in table.columns}
    numeric = {str(name): one for name in table.columns if (one := _numbers(table[name])) is not None}
    _time(table, numeric, guessed)
    if not _single_axis(numeric, guessed):
        _axes(content, numeric, guessed)
    _others(content, table, numeric, guessed)
    sheet = _sheet(table, numeric, guessed)
    return Guesses(guessed, _time_unit(content, numeric, guessed), _output(content, numeric, guessed), sheet)


def _sheet(table: pd.DataFrame, numeric: dict[str, NDArray[np.float64]], guessed: dict[str, Guess]) -> bool:
    """Whether the rows are positions, each with a label of its own; the labels are then those of the dwells."""
    if _column(guessed, "time") or not all(_column(guessed, axis) for axis in "xyz") or len(table) > _MOST_POSITIONS:
        return False
    for name in table.columns:
        if str(name) not in numeric and table[name].notna().all() and table[name].nunique() == len(table) > 1:
            guessed[str(name)] = Guess("dwell", "a label of its own in each row")
            return True
    return False


def measurable(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Numbers without those too large to be measured: their squares would overflow."""
    return np.where(np.abs(numbers) <= LARGEST, numbers, np.nan)


def _numbers(column: pd.Series) -> NDArray[np.float64] | None:
    if column.dtype.kind in "mM" or isinstance(column.dtype, pd.DatetimeTZDtype) or column.dtype.kind == "b":
        return None
    numbers = measurable(np.asarray(pd.to_numeric(column, errors="coerce"), dtype=np.float64))
    return numbers if np.mean(np.isfinite(numbers)) > 0.5 else None


def _grows(numbers: NDArray[np.float64]) -> bool:
    steps = np.diff(numbers[np.isfinite(numbers)])
    return steps.size > 1 and bool(np.mean(steps >= 0.0) > 0.99) and bool(np.any(steps > 0.0))


def _time(table: pd.DataFrame, numeric: dict[str, NDArray[np.float64]], guessed: dict[str, Guess]) -> None:
    for name in guessed:
        if values.is_moment(table[name]) or (name not in numeric and _reads_as_time(table[name])):
            guessed[name] = Guess("time", "stamps of date or time")
            return
    growing = [name for name, numbers in numeric.items() if _grows(numbers)]
    named = [name for name in growing if _TIME.search(name) and not _COUNT.search(name)]
    if named:
        guessed[named[0]] = Guess("time", "its name, and it only increases")
        return
    even = [name for name in growing if not _COUNT.search(name) and not _AXIS.search(name)]
    if even:
        guessed[even[0]] = Guess("time", "the first column that only increases")


def _reads_as_time(column: pd.Series) -> bool:
    head = column.dropna().head(50).reset_index(drop=True)
    if not len(head) or not clocks.is_stamps(head):
        return False
    try:
        clocks.stamps(head, "")
    except Exception:  # noqa: BLE001 - whatever it is, it is no stamp
        return False
    return True


_REFERENCE = re.compile(r"^(?:force|ref|true|applied)\w*$|^g(?:_in)?$", re.IGNORECASE)
_TILT = re.compile(r"angle|tilt|incl|theta|^deg", re.IGNORECASE)
_SINGLE_OUT = re.compile(r"^(?:out|volt|output|acc|signal|reading|lsb|counts?|u)\w*$|^v$", re.IGNORECASE)
_FOLLOWS = 0.99
"""Correlation of an output with its reference from which a table is that of one axis."""


def _single_axis(numeric: dict[str, NDArray[np.float64]], guessed: dict[str, Guess]) -> bool:
    """Whether a table is that of a device with one axis: one output follows one force, or the sine or cosine of one angle."""
    forces = [name for name in numeric if _REFERENCE.search(name)]
    angles = [name for name in numeric if _TILT.search(name)]
    outputs = [name for name in numeric if _SINGLE_OUT.search(name) and name not in (*forces, *angles)]
    if len(outputs) != 1 or len(forces) + len(angles) != 1:
        return False
    (output,), ((reference,), meaning) = outputs, (forces, "force_x") if forces else (angles, "tilt")
    expected = numeric[reference] if forces else np.sin(np.radians(numeric[reference]))
    there = np.isfinite(expected) & np.isfinite(numeric[output])
    if np.count_nonzero(there) < 2 or min(np.ptp(expected[there]), np.ptp(numeric[output][there])) == 0.0:
        return False
    if abs(float(np.corrcoef(expected[there], numeric[output][there])[0, 1])) < _FOLLOWS:
        return False
    guessed[output] = Guess("x", "the one output, which follows its reference")
    guessed[reference] = Guess(meaning, "the reference of the one output")
    spread = [name for name in numeric if re.match(r"^(?:sd|std|noise|sigma)", name, re.IGNORECASE)]
    count = [name for name in numeric if re.match(r"^(?:n|samples|count)$", name, re.IGNORECASE)]
    guessed |= {name: Guess("sd_x", "its name") for name in spread[:1]} | {
        name: Guess("n", "its name") for name in count[:1]
    }
    return True


def _axes(content: Content, numeric: dict[str, NDArray[np.float64]], guessed: dict[str, Guess]) -> None:
    free = [name for name in numeric if not guessed[name].meaning][:_MOST_COLUMNS]
    named: dict[str, dict[str, str]] = {}
    for name in free:
        axis = _AXIS.search(name)
        if axis and not _OTHER.search(name):
            # the same name with another letter: acc_x, acc_y, acc_z
            stem = name[: axis.start(1)] + "?" + name[axis.end(1) :]
            named.setdefault(stem, {})[axis[1].lower()] = name
    triples = [axes for axes in named.values() if len(axes) == 3]
    triples.sort(
        key=lambda axes: not (_ACCELERATION.search(axes["x"]) or output_unit(content.units.get(axes["x"], "")))
    )
    if triples:
        for axis, name in triples[0].items():
            guessed[name] = Guess(axis, "its name")
        return
    stated = [name for name in free if output_unit(content.units.get(name, ""))]
    if len(stated) == 3:
        for axis, name in zip("xyz", stated, strict=True):
            guessed[name] = Guess(axis, f"one of three columns in {content.units[name]}")
        return
    live = [name for name in free if not _OTHER.search(name) and not _HEAT.search(name) and not _COUNT.search(name)]
    best = _steadiest(numeric, live)
    for axis, name in zip("xyz", best, strict=False):
        guessed[name] = Guess(axis, "the three columns whose norm changes least, as gravity's does")


def _steadiest(numeric: dict[str, NDArray[np.float64]], names: list[str]) -> tuple[str, ...]:
    """The three neighbouring columns with the steadiest norm, each of which changes; empty if there are not three."""
    live = [name for name in names if np.nanstd(numeric[name][:_SOME]) > 0.0]
    threes = [
        three for three in combinations(live, 3) if len(live) < 6 or live.index(three[2]) - live.index(three[0]) == 2
    ]

    def unsteady(three: tuple[str, ...]) -> float:
        size = np.linalg.norm(np.column_stack([numeric[name][:_SOME] for name in three]), axis=1)
        middle = float(np.nanmedian(size))
        return float(np.nanmedian(np.abs(size - middle))) / middle if middle > 0.0 else np.inf

    return min(threes, key=unsteady, default=())


def _others(
    content: Content, table: pd.DataFrame, numeric: dict[str, NDArray[np.float64]], guessed: dict[str, Guess]
) -> None:
    for name in list(guessed):
        if guessed[name].meaning:
            continue
        spread = _SPREAD.match(name)
        if name in numeric and spread:
            guessed[name] = Guess(f"sd_{spread[1].lower()}", "its name")
        elif name in numeric and (_HEAT.search(name) or TEMPERATURE.get(content.units.get(name, "").lower())):
            middle = float(np.nanmedian(numeric[name]))
            if -100.0 < middle < 500.0 and not _column(guessed, "temperature"):
                guessed[name] = Guess("temperature", "its name or unit")
        elif name not in numeric and not _column(guessed, "dwell"):
            distinct = int(table[name].nunique())
            if 1 < distinct <= max(2, len(table) // 10):
                guessed[name] = Guess("dwell", f"{distinct} labels")


def _time_unit(content: Content, numeric: dict[str, NDArray[np.float64]], guessed: dict[str, Guess]) -> Guess:
    name = _column(guessed, "time")
    if not name or name not in numeric:
        return Guess("", "")
    numbers = numeric[name][np.isfinite(numeric[name])]
    seen = clocks.recognised(numbers, name, content.units.get(name, ""))
    if seen.unit or not seen.possible:
        return Guess(seen.unit, seen.reason)
    step, possible = typical_step(numbers), seen.possible
    heat = _column(guessed, "temperature")
    if heat:
        change, span = float(np.nanmax(numeric[heat]) - np.nanmin(numeric[heat])), float(numbers[-1] - numbers[0])
        slow = tuple(unit for unit in possible if change <= _FASTEST_K_S * span * clocks.TIME_UNITS[unit])
        if len(slow) == 1 and len(possible) > 1:
            return Guess(
                slow[0], f"{seen.reason}; in any other unit the temperature changes faster than {_FASTEST_K_S:g} K/s"
            )
        possible = slow or possible
    near = min(possible, key=lambda unit: abs(np.log(1.0 / (step * clocks.TIME_UNITS[unit]) / _LIKELY_HZ)))
    rates = ", ".join(f"{1.0 / (step * clocks.TIME_UNITS[unit]):.4g} Hz in {unit}" for unit in possible)
    return Guess(near, f"{seen.reason} allow {rates}: check")


def _output(  # noqa: PLR0911 - one answer per reason
    content: Content, numeric: dict[str, NDArray[np.float64]], guessed: dict[str, Guess]
) -> Guess:
    names = [name for axis in "xyz" for name, guess in guessed.items() if guess.meaning == axis]
    if len(names) != 3:
        return Guess("", "")
    stated = {output_unit(content.units.get(name, "")) for name in names}
    if len(stated) == 1 and "" not in stated:
        return Guess(stated.pop(), "the file states it")
    output = np.column_stack([numeric[name] for name in names])
    output = output[np.isfinite(output).all(axis=1)]
    if not len(output):
        return Guess("", "")
    size = unit_check.size_of(output)
    whole = bool(np.all(output[:1000] == np.rint(output[:1000])))
    likely = unit_check.looks_like(size)
    if likely and not (whole and likely != "mg"):
        doubt = ", though whole numbers may be counts: check" if whole else ""
        return Guess(likely, f"its norm is {size:.5g}, gravity in {likely} is {unit_check.GRAVITY[likely]:.5g}{doubt}")
    if whole:
        return Guess("LSB", f"whole numbers with a norm of {size:.5g}")
    if unit_check.VOLTS_PER_G[0] <= size <= unit_check.VOLTS_PER_G[1]:
        return Guess("V", f"its norm is {size:.5g}, no size of gravity, but one of volts: check")
    return Guess("LSB", f"its norm is {size:.5g}, neither gravity nor volts: check")


def guesses_of_dwells(table: pd.DataFrame) -> Guesses:
    """The meanings of the columns of the exchange format, by their names; further columns of numbers are covariates."""
    columns: dict[str, Guess] = {}
    for name in map(str, table.columns):
        if name in _OF_EXCHANGE or name in KNOWN_COLUMNS:
            columns[name] = Guess(_OF_EXCHANGE.get(name, "recorded quantity"), "its name")
        elif table[name].dtype.kind in "fiu":
            columns[name] = Guess("covariate", "further numbers")
        else:
            columns[name] = Guess("", "")
    stated = sorted({str(unit) for unit in table["out_unit"].dropna()}) if "out_unit" in table else []
    output = Guess(stated[0], "column out_unit") if len(stated) == 1 else Guess("", "")
    return Guesses(columns, Guess("s", EXCHANGE), output)
