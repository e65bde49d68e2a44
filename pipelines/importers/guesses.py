"""Guesses of the meaning of the columns of an unknown file, with reasons: proposals for the user, never used by an import."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from inertial.arrays import Array, Flags
from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS, KNOWN_COLUMNS, LARGEST, OUTPUT_COLUMNS, SPREAD_COLUMNS
from pipelines.importers import clocks, named_columns, triads, unit_check, values
from pipelines.importers.clocks import typical_step
from pipelines.importers.content import Content
from pipelines.importers.stated_units import TEMPERATURE, output_unit

_TIME = re.compile(r"time|stamp|elapsed|epoch|zeit|^t$|^ts$|^t[_ \[(]|sec(ond)?s?\b|x_value|date|clock", re.IGNORECASE)
_FINE = re.compile(r"sample_?time_?fine", re.IGNORECASE)
"""Counter of Xsens devices in units of 100 µs (MT Low Level Communication Protocol, MTData2, SampleTimeFine)."""
FINE_HZ = 1e4
_AXIS = re.compile(r"(?:^|[_ .])[xyz](?:$|[_ .])", re.IGNORECASE)
_LETTER = re.compile(r"(?:^a?|acc|[_ .])([xyz])(?:$|[_ .\[(])", re.IGNORECASE)
_SPREAD = re.compile(
    r"^(?:sd|std|sigma|s)[_ .]*(?:acc\w*?|a|out)?[_ .]*([xyz])$|^([xyz])[_ .]*(?:sd|std|sigma)(?:$|[_ .(\[])",
    re.IGNORECASE,
)
_SCATTER = r"^(?:sd|std|noise|sigma)"
_OF_SENSOR = re.compile(r"imu|acc|gyr|gtemp|sensor|die|chip|mpu|unit", re.IGNORECASE)
_FASTEST_K_S = 2.0
"""Rate of temperature that no chamber reaches."""
_GROWS = re.compile(r"^(?:freq|f/|rpm|speed|angle|winkel)", re.IGNORECASE)
"""Names of what a test raises from row to row."""
_DAY = r"\s*\d{1,4}[./-]\d{1,2}[./-]\d{1,4}\s*"
_FEW = 30
_MOST_POSITIONS = 500
_LIKELY_HZ = 100.0
CHECK = ": check"
"""End of the reason of a unit of time that is one of several."""
EXCHANGE = "the exchange format"
_OF_EXCHANGE = {
    "unit": "unit",
    "dwell": "dwell",
    "time_s": "time",
    **dict(zip(OUTPUT_COLUMNS, "xyz", strict=True)),
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

    columns : column → guess · time_unit, output : units with their reasons; empty if unknown · sheet : whether each row is a
    position, by a separate label or by its distance from its neighbours · triad : what was seen of the three axes
    few : axis → column of a device with one axis or two
    """

    columns: dict[str, Guess]
    time_unit: Guess
    output: Guess
    sheet: bool = False
    triad: triads.Triad = field(default_factory=triads.Triad)
    few: dict[str, str] = field(default_factory=dict[str, str])

    @property
    def dwells(self) -> bool:
        """Whether rows look like dwells: standard deviations beside the means, or a different label in each row."""
        return self.sheet or bool(self.single) or all(self.column(f"sd_{axis}") for axis in "xyz")

    @property
    def single(self) -> str:
        """The output of a table of a device with one axis: it has its reference beside it, a force or an angle; else empty."""
        known = self.column("force_x") or self.column("tilt")
        return self.column("x") if known and not self.column("y") else ""

    def column(self, meaning: str) -> str:
        """The column with a meaning; empty if there is none."""
        return _column(self.columns, meaning)


def _column(guessed: dict[str, Guess], meaning: str) -> str:
    return next((name for name, guess in guessed.items() if guess.meaning == meaning), "")


def guesses(content: Content, serial: str = "") -> Guesses:
    """Guesses of what the columns of a file mean, by names, units and numbers.

    serial : the column of serial numbers, where more than its name shows it
    """
    table = content.table
    guessed: dict[str, Guess] = {str(name): Guess("", "") for name in table.columns}
    numeric = {str(name): numbers for name in table.columns if (numbers := _numbers(table[name])) is not None}
    inside = _named(table, numeric, guessed, serial)
    _time(content, numeric, guessed, inside)
    found = triads.Triad() if _single_axis(numeric, guessed) else _axes(content, numeric, guessed)
    _others(content, table, numeric, guessed)
    sheet = _sheet(table, numeric, guessed, inside)
    positions = not _column(guessed, "time") and triads.are_positions(found.sphere, len(table))
    rows = Guesses(guessed, Guess("", ""), Guess("", ""), sheet or positions, found)
    if rows.dwells:
        if timed := _timed_anew(table, numeric, guessed):
            return guesses(content, timed)
        _of_dwells(numeric, guessed, inside)
    time_unit = _time_unit(content, numeric, guessed, dwells=rows.dwells)
    few = _few_axes(content, numeric, guessed)
    names = [column for axis in "xyz" if (column := few.get(axis) or _column(guessed, axis))]
    output = _output(content, numeric, names, found.sphere, means=rows.dwells)
    return replace(rows, time_unit=time_unit, output=output, few=few)


def _timed_anew(table: pd.DataFrame, numeric: dict[str, Array], guessed: dict[str, Guess]) -> str:
    """The labels at each of which the time begins anew, as at the next unit of a table of dwells; empty where there are none."""
    label = _column(guessed, "dwell")
    inside = named_columns.of_one_unit(table, label)
    steps = [np.diff(numbers) for name, numbers in numeric.items() if _TIME.search(name)]
    anew = not inside.all() and any(np.array_equal(step > 0.0, inside) for step in steps)
    return label if anew and label not in numeric and not _column(guessed, "unit") else ""


def _named(table: pd.DataFrame, numeric: dict[str, Array], guessed: dict[str, Guess], serial: str) -> Flags:
    """Note the columns whose name tells; which steps from row to row (n − 1,) stay in one unit."""
    reason = "the time begins anew at each" if serial else "its name"
    if serial := serial or named_columns.serials(table):
        guessed[serial] = Guess("unit", reason)
    for name, meaning in named_columns.MEANING_OF.items():
        sound = name in numeric and name != serial and bool(np.isfinite(numeric[name]).all())
        if sound and name not in named_columns.OF_DWELLS:
            guessed[name] = Guess(meaning, "its name")
    return named_columns.of_one_unit(table, serial)


def _of_dwells(numeric: dict[str, Array], guessed: dict[str, Guess], inside: Flags) -> None:
    """Note what is read so in a table of dwells alone: the number of samples, the force, and the numbers of the dwells."""
    if not set(FORCE_COLUMNS) & {guess.meaning for guess in guessed.values()}:
        acting = triads.references({name: numbers for name, numbers in numeric.items() if not guessed[name].meaning})
        for force, name in zip(FORCE_COLUMNS, acting, strict=False):
            guessed[name] = Guess(force, "its name, and its size is that of gravity")
    for name in named_columns.OF_DWELLS:
        if name in numeric and not guessed[name].meaning:
            guessed[name] = Guess(named_columns.MEANING_OF[name], "its name")
    free = [name for name, guess in guessed.items() if not guess.meaning]
    number = "" if _column(guessed, "dwell") else named_columns.numbers_of_dwells(numeric, inside, free)
    if number:
        guessed[number] = Guess("dwell", "it numbers the rows of each unit")


def _sheet(table: pd.DataFrame, numeric: dict[str, Array], guessed: dict[str, Guess], inside: Flags) -> bool:
    """Whether the rows are positions, each with a different label; these are then the labels of the dwells."""
    label = _column(guessed, "dwell")
    if label and named_columns.numbers_of_dwells(numeric, inside, [label]):
        return True
    if _column(guessed, "time") or not all(_column(guessed, axis) for axis in "xyz") or len(table) > _MOST_POSITIONS:
        return False
    for name in table.columns:
        if str(name) not in numeric and table[name].notna().all() and table[name].nunique() == len(table) > 1:
            guessed[str(name)] = Guess("dwell", "a label of its own in each row")
            return True
    return False


def measurable(numbers: Array) -> Array:
    """Numbers without those too large to be measured: their squares would overflow."""
    return np.where(np.abs(numbers) <= LARGEST, numbers, np.nan)


def _numbers(column: pd.Series) -> Array | None:
    if values.is_moment(column) or column.dtype.kind == "b":
        return None
    numbers = measurable(np.asarray(pd.to_numeric(column, errors="coerce"), dtype=np.float64))
    return numbers if np.mean(np.isfinite(numbers)) > 0.5 else None


def _grows(numbers: Array, inside: Flags | None = None) -> bool:
    """Whether numbers (n,) only increase, with few exceptions, in all rows or in the steps of one unit."""
    there = np.isfinite(numbers)
    steps = np.diff(numbers[there]) if inside is None else np.diff(numbers)[inside & there[1:] & there[:-1]]
    return steps.size > 1 and bool(np.mean(steps >= 0.0) > 0.99) and bool(np.any(steps > 0.0))


def _time(content: Content, numeric: dict[str, Array], guessed: dict[str, Guess], inside: Flags) -> None:
    if _column(guessed, "time"):
        return
    table = content.table
    free = [name for name, guess in guessed.items() if not (guess.meaning or _is_of_else(name, content.units))]
    for name in free:
        if values.is_moment(table[name]) or (name not in numeric and _reads_as_time(table[name])):
            guessed[name] = Guess("time", "stamps of date or time")
            return
    growing = [name for name in free if name in numeric and (_grows(numeric[name]) or _grows(numeric[name], inside))]
    fine = [name for name in growing if _FINE.search(name)]
    uncounted = [name for name in growing if not triads.COUNT.search(name)]
    named = fine or [name for name in uncounted if _TIME.search(name)]
    even = [name for name in uncounted if not (_AXIS.search(name) or triads.is_row_number(numeric[name]))]
    even = [name for name in even if np.mean(np.diff(numeric[name]) > 0.0) > 0.5]  # not two levels of something else
    if named:
        guessed[named[0]] = Guess("time", "its name, and it only increases")
    elif even:
        guessed[even[0]] = Guess("time", "the first column that only increases")


def _is_of_else(name: str, units: Mapping[str, str]) -> bool:
    """Whether name or unit say another quantity than time: an angle, a temperature, a frequency, a sensitivity."""
    unit = units.get(name, "")
    other = "/" in unit or output_unit(unit) not in {"", "LSB"} or not triads.may_be_output("", unit)
    return other or _GROWS.search(name) is not None


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
_TILT = re.compile(r"angle|tilt|incl|theta|^deg|winkel|neigung", re.IGNORECASE)
_SINGLE_OUT = re.compile(r"(?i)^((out|volt|acc|signal|read|lsb|count|u(?!nit))\w*|v|a?[xyz](_(m?[gv]|lsb))?)$")
_FOLLOWS = 0.99
"""Correlation of an output with its reference from which a table is that of one axis."""


def _single_axis(numeric: dict[str, Array], guessed: dict[str, Guess]) -> bool:
    """Whether a table is that of a device with one axis: one output follows one force, or the sine or cosine of one angle."""
    plain = {name: re.sub(r"\s*[\[(].*$", "", name) for name in numeric}  # without a unit in brackets
    forces = [name for name in numeric if _REFERENCE.search(plain[name])]
    angles = [name for name in numeric if _TILT.search(name)]
    outputs = [name for name in numeric if _SINGLE_OUT.search(plain[name]) and name not in (*forces, *angles)]
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
    for pattern, further in ((_SCATTER, "sd_x"), (r"^(?:n|samples|count)$", "n")):
        named = [name for name in numeric if re.match(pattern, name, re.IGNORECASE)]
        guessed |= {name: Guess(further, "its name") for name in named[:1]}
    return True


def _axes(content: Content, numeric: dict[str, Array], guessed: dict[str, Guess]) -> triads.Triad:
    free = {name: numbers for name, numbers in numeric.items() if not guessed[name].meaning and not _is_index(numbers)}
    found = triads.triad(free, content.units)
    for axis, name in zip("xyz", found.names, strict=False):
        guessed[name] = Guess(axis, found.reason)
    return found


def _few_axes(content: Content, numeric: dict[str, Array], guessed: dict[str, Guess]) -> dict[str, str]:
    """The columns of a device with one axis or two: all that is left of a record in time; the axis by its name, else in order.

    Where some of them state a unit of an output, the others are none; nor is the scatter of an output.
    """
    if not _column(guessed, "time") or any(_column(guessed, axis) for axis in "xyz"):
        return {}
    left = [name for name, numbers in numeric.items() if not guessed[name].meaning and not _is_index(numbers)]
    left = [name for name in left if triads.may_be_output(name, content.units.get(name, ""))]
    left = [name for name in left if output_unit(content.units.get(name, ""))] or left
    left = [name for name in left if not re.match(_SCATTER, name, re.IGNORECASE)] or left
    named = [found[1].lower() if (found := _LETTER.search(name)) else "" for name in left]
    letters = named if all(named) and len(set(named)) == len(named) else list("xyz"[: len(left)])
    return dict(sorted(zip(letters, left, strict=True))) if len(left) in (1, 2) else {}


def _is_index(numbers: Array) -> bool:
    """Whether a column numbers the rows, or only grows as a clock does: no output of a sensor."""
    return triads.is_row_number(numbers) or (numbers.size > _FEW and _grows(numbers))


def _others(content: Content, table: pd.DataFrame, numeric: dict[str, Array], guessed: dict[str, Guess]) -> None:
    warm = "" if _column(guessed, "temperature") else _temperature(content, numeric, guessed)
    if warm:
        guessed[warm] = Guess("temperature", "its name or unit")
    for name in list(guessed):
        if guessed[name].meaning:
            continue
        spread = _SPREAD.match(name)
        if name in numeric and spread:
            guessed[name] = Guess(f"sd_{(spread[1] or spread[2]).lower()}", "its name")
        elif name not in numeric and table[name].dtype.kind not in "fiuM" and not _column(guessed, "dwell"):
            if table[name].astype(str).str.fullmatch(_DAY).mean() > 0.5:
                continue  # a day is no pose
            distinct = int(table[name].nunique())
            if 1 < distinct <= max(2, len(table) // 10):
                guessed[name] = Guess("dwell", f"{distinct} labels")


def _temperature(content: Content, numeric: dict[str, Array], guessed: dict[str, Guess]) -> str:
    """The column of the sensor's temperature: named so before others, changing before constant."""

    def rank(name: str) -> tuple[bool, bool]:
        return bool(np.nanstd(numeric[name]) > 0.0), bool(_OF_SENSOR.search(name))

    warm = [
        name
        for name in numeric
        if not guessed[name].meaning
        and (triads.HEAT.search(name) or TEMPERATURE.get(content.units.get(name, "").lower()))
        and -100.0 < float(np.nanmedian(numeric[name])) < 500.0
    ]
    return max(warm, key=rank, default="")


def _time_unit(content: Content, numeric: dict[str, Array], guessed: dict[str, Guess], *, dwells: bool) -> Guess:
    name = _column(guessed, "time")
    if not name or name not in numeric:
        return Guess("", "")
    if _FINE.search(name):
        return Guess("samples", f"counts of {1e6 / FINE_HZ:.0f} µs, by its name")
    numbers = numeric[name][np.isfinite(numeric[name])]
    seen = clocks.recognised(numbers, name, content.units.get(name, ""))
    if dwells and (not seen.unit or seen.reason.startswith("steps")):
        return Guess("s", "rows are dwells, and no other unit is stated")
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
    return Guess(near, f"{seen.reason} allow {', '.join(clocks.rates_in(step, possible))}{CHECK}")


def _output(
    content: Content,
    numeric: dict[str, Array],
    names: list[str],
    sphere: triads.Sphere | None,
    *,
    means: bool,
) -> Guess:
    """The unit of the outputs ``names``: that which they state, or that which the numbers of three axes show.

    A unit that the numbers do not settle is a guess with a doubt, which the user has to confirm.
    """
    stated = {output_unit(content.units.get(name, "")) for name in names}
    if len(stated) == 1 and "" not in stated:
        return Guess(stated.pop(), "the file states it")
    if len(names) != 3:
        return Guess("", "")
    output = np.column_stack([numeric[name] for name in names])
    output = output[np.isfinite(output).all(axis=1)]
    if not len(output):
        return Guess("", "")
    size = sphere.radius if sphere is not None and sphere.fits else unit_check.size_of(output)
    return Guess(*unit_check.unit_of(output, size, means=means))


def guesses_of_dwells(table: pd.DataFrame) -> Guesses:
    """The meanings of the columns of the exchange format, by their names; further columns of numbers are covariates."""
    columns: dict[str, Guess] = {}
    for name in map(str, table.columns):
        further = Guess("covariate", "further numbers") if table[name].dtype.kind in "fiu" else Guess("", "")
        known = name in _OF_EXCHANGE or name in KNOWN_COLUMNS
        columns[name] = Guess(_OF_EXCHANGE.get(name, "recorded quantity"), "its name") if known else further
    stated = sorted({str(unit) for unit in table["out_unit"].dropna()}) if "out_unit" in table else []
    output = Guess(stated[0], "column out_unit") if len(stated) == 1 else Guess("", "")
    return Guesses(columns, Guess("s", EXCHANGE), output)
