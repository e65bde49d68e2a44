"""Seconds from the time of a foreign file: stamps of date and time, Unix time, counters in s, ms, µs or ns.

The unit of a counter is what the file states, else what its steps allow; if they allow several, it must be given. A given unit
that contradicts the file is refused; a unit that contradicts the steps gives a remark.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from inertial.arrays import Array
from pipelines.importers import values
from pipelines.importers.local_time import local_seconds
from pipelines.importers.mapping import TIME_UNITS
from schemas.errors import DataRejected, WrongUse
from schemas.foreign import foreign, shown

EPOCH_S = (9.46e8, 4.1e9)
"""Unix time of the years 2000 to 2099."""
USUAL_HZ = (0.5, 5e4)
"""Rates of samples of accelerometers, of recorders and of loggers."""
_NAMED = re.compile(r"(?:^|[_\s.\-\[(])(s|sec|secs|second|seconds|ms|msec|milli|millis|milliseconds?|us|µs|μs|usec|micros|"
                    r"microseconds?|ns|nsec|nanos|nanoseconds?)[\])]?\s*$", re.IGNORECASE)  # fmt: skip
_BEGINNINGS = {"ns": ("nsec", "nano"), "us": ("usec", "micro"), "ms": ("msec", "milli")}
_CLOCK = re.compile(r"^\s*(\d{1,2}:\d{2}:\d{2}(?:[.,:]\d+)?)\s*$")
_MINUTES = re.compile(r"^\s*(\d{1,3}):([0-5]\d[.,]\d+)\s*$")
"""Minutes and seconds, as a spreadsheet shows a time of day with fractions: without hours, 59:59.9 is followed by 00:00.0."""
_FRACTION = re.compile(r"(:\d{2}),(\d+)")
_ZONED = re.compile(r":\d{2}(?:\.\d*)?\s*(?:Z|UTC|[+-]\d{2}:?\d{0,2})$", re.IGNORECASE)
_FORMATS = (
    *("ISO8601", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S"),
    *("%Y/%m/%d %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S"),
)
_DAY_FIRST = ("%d/%m/%Y %H:%M:%S.%f", "%d/%m/%Y %H:%M:%S")
_MONTH_FIRST = ("%m/%d/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %I:%M:%S.%f %p")
_DAY_S, _HOUR_S = 86_400.0, 3600.0


@dataclass(frozen=True)
class RecordingClock:
    """Seconds (n,) from any beginning, and how the column was read."""

    seconds: Array
    unit: str
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Recognised:
    """A unit of time (empty if several or none are possible), the reason, and the possible units."""

    unit: str
    reason: str
    possible: tuple[str, ...]


def unit_stated(text: str) -> str:
    """The unit of time that a text names, as one of s, ms, us, ns; empty if it names none."""
    word = text.strip().lower().replace("µ", "u").replace("μ", "u")
    if word in {"s", "sec", "secs", "second", "seconds"}:
        return "s"
    return next((unit for unit, words in _BEGINNINGS.items() if word == unit or word.startswith(words)), "")


def recognised(numbers: Array, name: str, stated: str = "") -> Recognised:
    """The unit of a column of time.

    Parameters
    ----------
    numbers : (n,), finite.
    name : of the column; `time_ms` states a unit.
    stated : unit that the file states elsewhere.
    """
    unit = unit_stated(stated)
    if unit:
        return Recognised(unit, f"the file states {stated}", (unit,))
    epoch = _epoch(numbers)
    if epoch:
        return Recognised(epoch, f"Unix time, in {epoch}", (epoch,))
    match = _NAMED.search(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name))
    unit = unit_stated(match[1]) if match else ""
    if unit and match and match[0].strip() != name.strip():
        return Recognised(unit, f"the name '{shown(name)}'", (unit,))
    return _by_steps(numbers)


def _by_steps(numbers: Array) -> Recognised:
    step = typical_step(numbers)
    if not step > 0.0:
        return Recognised("", "time does not increase", ())
    possible = tuple(unit for unit, factor in TIME_UNITS.items() if USUAL_HZ[0] <= 1.0 / (step * factor) <= USUAL_HZ[1])
    fractions = bool(np.any(numbers != np.rint(numbers)))
    if "s" in possible and step < 1.0 and fractions:
        possible = ("s",)  # counters of ms and shorter units in fractions state the unit in their names
    return Recognised(possible[0] if len(possible) == 1 else "", f"steps of {step:.6g}", possible)


def typical_step(numbers: Array) -> float:
    """Median of the steps; where most are zero (stamps coarser than the rate), the mean step."""
    if numbers.size < 2:
        return 0.0
    step = float(np.median(np.diff(numbers)))
    return step if step > 0.0 else float(numbers[-1] - numbers[0]) / (numbers.size - 1)


def _epoch(numbers: Array) -> str:
    middle, step = float(np.median(numbers)), typical_step(numbers)
    for unit, factor in TIME_UNITS.items():
        if EPOCH_S[0] <= middle * factor <= EPOCH_S[1] and 1e-3 <= 1.0 / max(step * factor, 1e-30) <= 1e7:
            return unit
    return ""


def stamps(column: pd.Series, where: str, zone: str = "") -> RecordingClock:
    """The clock of stamps of date and time, or of the time of day.

    Parameters
    ----------
    zone : of stamps with a date that state none; empty: not known

    Raises
    ------
    DataRejected
        A row has no time, or day and month are ambiguous and matter.
    """
    name = shown(str(column.name))
    with foreign(f"{where}: column '{name}': bytes that are no text", "give seconds, or ISO stamps"):
        text = column.astype(str).str.strip().str.replace(_FRACTION, r"\1.\2", regex=True)
    if column.notna().all() and bool(text.str.match(_CLOCK).all()):
        with foreign(f"{where}: column '{name}': times of day that cannot be read", "give seconds, or ISO stamps"):
            pointed = text.str.replace(r":(\d+)$", r".\1", regex=True) if text.iloc[0].count(":") == 3 else text
            spans = pd.to_timedelta(pointed)
        return RecordingClock(_unwrapped(np.asarray(spans.dt.total_seconds(), dtype=np.float64), _DAY_S), "s", ())
    if column.notna().all() and bool(text.str.match(_MINUTES).all()):
        parts = text.str.replace(",", ".", regex=False).str.split(":", expand=True).astype(float).to_numpy()
        return RecordingClock(_unwrapped(60.0 * parts[:, 0] + parts[:, 1], _HOUR_S), "s", ())
    plain = _read(text, _FORMATS, where, zone)
    if plain is not None:
        return plain
    candidates = [
        instants for forms in (_DAY_FIRST, _MONTH_FIRST) if (instants := _read(text, forms, where, zone)) is not None
    ]
    if len(candidates) == 2 and not np.allclose(candidates[0].seconds, candidates[1].seconds):
        raise DataRejected(
            f"{where}: column '{name}': '{shown(column.iloc[0])}': day and month are ambiguous, and the date changes; "
            "write the dates as 2026-12-31"
        )
    if candidates:
        return candidates[0]
    row = _first_bad(text)
    raise DataRejected(
        f"{where}: row {row + 1}, column '{name}': found {shown(column.iloc[row])!r}, a time is needed: a number, ISO 8601 "
        "(2026-12-31T23:59:59.5), DD.MM.YYYY hh:mm:ss or hh:mm:ss; repair the row, map another column, or give --rate HZ"
    )


def _unwrapped(seconds: Array, period_s: float) -> Array:
    """Seconds since the first of a clock that begins again after each period."""
    periods = np.cumsum(np.concatenate([[0.0], np.diff(seconds) < -0.5 * period_s]))
    return seconds + period_s * periods - seconds[0]


def _read(text: pd.Series, forms: Sequence[str], where: str, zone: str) -> RecordingClock | None:
    """The clock by the first form that every row has; None where there is none."""
    for form in forms:
        try:
            parsed = pd.to_datetime(text, format=form, utc=True, errors="raise")
        except (ValueError, OverflowError, TypeError):
            continue
        if not parsed.isna().any():
            if _ZONED.search(text.iloc[0]):
                return RecordingClock(values.seconds(parsed, where), "s", ())
            seconds, remarks = local_seconds(parsed.dt.tz_localize(None), zone, where)
            return RecordingClock(seconds, "s", remarks)
    return None


def _first_bad(text: pd.Series) -> int:
    """The first row that ISO 8601 does not read, or the first at all."""
    parsed = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
    bad = np.flatnonzero(parsed.isna().to_numpy())
    return int(bad[0]) if bad.size and bad.size < len(text) else 0


def is_stamps(column: pd.Series) -> bool:
    """Whether a column holds text that is not a number, such as stamps."""
    if column.dtype.kind in "fiubmM" or isinstance(column.dtype, pd.DatetimeTZDtype):
        return False
    some = column.dropna().head(20)
    return bool(len(some)) and bool(pd.to_numeric(some, errors="coerce").isna().mean() > 0.5)


def clock(numbers: Array, name: str, claimed: str, stated: str, where: str) -> RecordingClock:
    """Seconds of a column of numbers.

    Parameters
    ----------
    numbers : (n,), finite.
    claimed : unit that was given; empty to recognise it.
    stated : unit that the file states; empty if it states none.

    Raises
    ------
    WrongUse
        Several units are possible, or the given unit contradicts the file.
    """
    recognition = recognised(numbers, name, stated)
    column, step = f"column '{shown(name)}'", typical_step(numbers)
    possible, found = recognition.possible or tuple(TIME_UNITS), f"steps of {step:.6g}"
    if not claimed and not recognition.unit and step > 0.0:
        raise WrongUse(
            f"{where}: {column}: {found}: {', '.join(rates_in(step, possible))}; the unit is needed; add --unit-of time="
            f"{'|'.join(possible)}"
        )
    if claimed and recognition.unit and claimed != recognition.unit and not recognition.reason.startswith("steps"):
        raise WrongUse(
            f"{where}: {column}: {recognition.reason}, but --unit-of time={claimed} was given; leave it out, or correct it"
        )
    unit = claimed or recognition.unit or "s"
    seconds = (numbers - numbers[0]) * TIME_UNITS[unit]  # the difference keeps the digits of Unix time in ns
    if claimed:
        return RecordingClock(seconds, unit, _doubts(step, unit, recognition, column))
    apart = step * TIME_UNITS[unit]
    rate = f", {1.0 / apart:.4g} Hz for {apart * (len(numbers) - 1):.5g} s" if apart > 0.0 else ""
    return RecordingClock(seconds, unit, (f"{column}: time in {unit} ({recognition.reason}){rate}",))


def rates_in(step: float, units: Sequence[str]) -> list[str]:
    """The rates of samples, Hz, that a step means in some units."""
    return [f"{1.0 / (step * TIME_UNITS[unit]):.4g} Hz in {unit}" for unit in units]


def _doubts(step: float, unit: str, recognition: Recognised, column: str) -> tuple[str, ...]:
    """A remark if the given unit leads to an unusual rate and another unit to a usual one."""
    if not step > 0.0:
        return ()
    rate = 1.0 / (step * TIME_UNITS[unit])
    if USUAL_HZ[0] <= rate <= USUAL_HZ[1] or not recognition.possible:
        return ()
    others = " or ".join(rates_in(step, recognition.possible))
    return (f"CHECK THE UNIT OF TIME: {column} in {unit} gives {rate:.4g} Hz; other units give {others}",)
