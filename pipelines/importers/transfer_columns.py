"""Columns of a transfer function in a file: which is frequency, magnitude, phase and their uncertainty, and in which units."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import ValidationError

from inertial.arrays import Array
from inertial.dynamics.transfer_effects import Conditions
from inertial.dynamics.transfer_model import Points
from pipelines.importers.content import Content, unit_in
from pipelines.importers.mapping import pairs
from pipelines.importers.stated_units import output_unit
from pipelines.importers.values import finite_column
from pipelines.procedures.sweep_points import SweepPart
from schemas.errors import DataRejected, WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.toml_files import explain, parse_toml, read_text
from schemas.units import STANDARD_GRAVITY_M_S2

DECIBEL = float(np.log(10.0)) / 20.0
"""Change of the logarithm of a magnitude for 1 dB."""
LINEAR, IN_DECIBEL, PER_M_S2 = "", "dB", "1/(m/s^2)"
OF_ANGLE = {"deg": 1.0, "rad": float(np.degrees(1.0))}
UNITS: Mapping[str, Mapping[str, float]] = {
    "frequency": {"Hz": 1.0, "kHz": 1e3, "rad/s": 0.5 / np.pi},
    "magnitude": {LINEAR: 1.0, IN_DECIBEL: DECIBEL, PER_M_S2: STANDARD_GRAVITY_M_S2},
    "phase": OF_ANGLE,
    "magnitude_uncertainty": {"%": 1.0, IN_DECIBEL: 100.0 * DECIBEL},
    "phase_uncertainty": OF_ANGLE,
}
"""Units of each meaning, and their size in Hz, of the logarithm, in degrees, in percent."""
ALIKE = {
    **{name.lower(): name for of in UNITS.values() for name in of},
    "percent": "%", "°": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad", "1/s": "rad/s",
}  # fmt: skip
NEEDED = ("frequency", "magnitude", "phase")
UNCERTAINTIES = ("magnitude_uncertainty", "phase_uncertainty")
COVERAGE = re.compile(r"[(\[,;]?\s*\bk\s*=\s*([1-9]\d*(?:\.\d+)?)\s*[)\]]?")
"""Coverage factor in the name of a column of expanded uncertainties, as in ``U [%] (k = 2)``."""
PER = re.compile(r"/\s*\(?\s*(g|m.*?)[)\]\s]*$")
STATED = {"repeatability_percent": "magnitude_uncertainty", "repeatability_deg": "phase_uncertainty"}
"""Keys of a sweep that state the uncertainty of every point."""
OPTIONAL = {"level_g": 1.0, "temperature_C": np.nan, "record_s": np.nan, "pressure_hPa": np.nan}
FEWEST = 8
_WORDS = {"frequency": ("freq",), "magnitude": ("mag", "gain", "sens", "betrag", "empfind"), "phase": ("phase",)}


@dataclass(frozen=True)
class PointsLayout:
    """The statements of a user: columns and units by meaning, and the uncertainty of every point, % and degrees."""

    columns: Mapping[str, str] = field(default_factory=dict[str, str])
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    every_point: Mapping[str, float] = field(default_factory=dict[str, float])


def stated_layout(columns: str, units: str, part: Path | None) -> PointsLayout:
    """The layout by ``--map``, ``--unit-of`` and the file of ``--set``.

    Raises
    ------
    WrongUse
        A meaning or a key is not one of points.
    RecipeInvalid
        A value of the file is not possible.
    """
    layout = pairs(columns, "--map"), pairs(units, "--unit-of")
    for option, given in zip(("--map", "--unit-of"), layout, strict=True):
        for meaning in given:
            if meaning not in UNITS:
                raise WrongUse(
                    f"import: {option} {shown(meaning)}=…: no column of points; {did_you_mean(meaning, UNITS)}"
                )
    content: dict[str, Any] = parse_toml(read_text(part, "part"), str(part)) if part else {}
    for key in content:
        if key not in STATED:
            raise WrongUse(f"{part}: key {shown(key)} is not for points that are measured; known: {', '.join(STATED)}")
    try:
        sweep = SweepPart.model_validate({"kind": "sweep"} | content)
    except ValidationError as problem:
        raise explain(problem, str(part), SweepPart) from None
    return PointsLayout(*layout, {STATED[key]: float(getattr(sweep, key)) for key in content})


def meanings_of_points(table: pd.DataFrame) -> dict[str, str]:
    """The meaning of each column of a transfer function; empty where names do not show frequency, magnitude and phase."""
    found = _columns(table, PointsLayout())
    return {column: meaning for meaning, column in found.items()} if set(NEEDED) <= found.keys() else {}


def transfer_points(content: Content, name: str, layout: PointsLayout) -> tuple[Points, str]:
    """The points of a table, and the columns that were recognised by other words than the product's own.

    Raises
    ------
    DataRejected
        A column is missing or has no unit, a value is no finite number, or there are fewer than eight points.
    """
    table = content.table
    found = _columns(table, layout)
    missing = [meaning for meaning in NEEDED if meaning not in found]
    if missing:
        there = ", ".join(shown(str(column)) for column in table.columns) or "none"
        raise DataRejected(
            f"{name}: no column is recognised as {', '.join(missing)} of a transfer function, found {there}; name them with "
            f"--map {','.join(f'{meaning}=…' for meaning in missing)}"
        )
    units = {meaning: _unit(content, layout, meaning, column, name) for meaning, column in found.items()}
    absent = [meaning for meaning in UNCERTAINTIES if meaning not in found and not layout.every_point.get(meaning)]
    if absent:
        raise DataRejected(
            f"{name}: the points have no {' and no '.join(meaning.replace('_', ' ') for meaning in absent)}, by which a model "
            f"is judged; name their columns with --map {','.join(f'{meaning}=…' for meaning in absent)}, or state that of every "
            "point in a file of --set: repeatability_percent = … and repeatability_deg = …"
        )
    value = {meaning: _values(table, column, name, meaning, units[meaning]) for meaning, column in found.items()}
    value |= {
        meaning: value[meaning] / float(factor[1])
        for meaning, column in found.items()
        if meaning in UNCERTAINTIES and (factor := COVERAGE.search(column))
    }
    value |= {
        meaning: np.full(len(table), size) for meaning, size in layout.every_point.items() if meaning not in found
    }
    other = {meaning: np.full(len(table), usual) for meaning, usual in OPTIONAL.items()}
    for meaning in OPTIONAL:
        if meaning in table.columns:
            other[meaning] = finite_column(table, meaning, name, "correct the row")
    if "pressure_hPa" in table.columns:
        _refuse_not_positive(other["pressure_hPa"], "pressure_hPa", name)
    if len(table) < FEWEST:
        raise DataRejected(f"{name}: {len(table)} points, at least {FEWEST} are needed; measure more frequencies")
    points = Points(
        Conditions(value["frequency"], *other.values()),
        np.asarray(value["magnitude"] * np.exp(1j * np.radians(value["phase"])), dtype=np.complex128),
        1e-2 * value["magnitude_uncertainty"],
        np.radians(value["phase_uncertainty"]),
    )
    told = [
        f"{meaning} '{shown(column)}'{f' in {units[meaning]}' if units[meaning] else ''}{', a lag' * _lags(meaning, column)}"
        for meaning, column in found.items()
    ]
    unread = [f"'{shown(column)}'" for column in map(str, table.columns) if column not in {*found.values(), *OPTIONAL}]
    told += [f"not read: {', '.join(unread)} (known besides: {', '.join(OPTIONAL)})"] if unread else []
    as_known = not unread and all(_own_name(meaning) in table.columns for meaning in found)
    return points, "" if as_known else ", ".join(told)


def _lags(meaning: str, column: str) -> bool:
    """Whether a column of phases counts the delay of the output as positive."""
    return meaning == "phase" and re.search(r"(?<![a-z])lag", column.lower()) is not None


def _own_name(meaning: str) -> str:
    """The name of a column in the format of the product."""
    ending = {"frequency": "_hz", "phase": "_deg", "magnitude_uncertainty": "_percent", "phase_uncertainty": "_deg"}
    return meaning + ending.get(meaning, "")


def _columns(table: pd.DataFrame, layout: PointsLayout) -> dict[str, str]:
    """The column of each meaning: as it is mapped, else the only column whose name shows the meaning."""
    found = {meaning: [str(name) for name in table.columns if _meaning(str(name)) == meaning] for meaning in UNITS}
    only = {meaning: names[0] for meaning, names in found.items() if len(names) == 1}
    numbered = {meaning: _named(table, column) for meaning, column in layout.columns.items()}
    return only | numbered


def _named(table: pd.DataFrame, column: str) -> str:
    """A column by its name, or its number from 1."""
    names = [str(name) for name in table.columns]
    if column not in names and column.isdigit() and 0 < int(column) <= len(names):
        return names[int(column) - 1]
    return column


def _meaning(name: str) -> str:
    """The meaning of a column by the words of its name; empty for none."""
    words = re.findall(r"[a-z]+", name.lower())
    of = [meaning for meaning, begins in _WORDS.items() if any(word.startswith(begins) for word in words)]
    if len(of) != 1:
        return ""
    uncertain = any(word in {"u", "uc", "unc", "uncertainty", "error", "sd", "std"} for word in words)
    meaning = f"{of[0]}_uncertainty" if uncertain else of[0]
    return meaning if meaning in UNITS else ""


def _unit(content: Content, layout: PointsLayout, meaning: str, column: str, where: str) -> str:
    """Unit of a column, of :data:`UNITS`: as stated by the command, else by the file, or at the end of its name."""
    given = layout.units.get(meaning, "")
    if column not in map(str, content.table.columns):
        there = did_you_mean(column, map(str, content.table.columns))
        raise DataRejected(f"{where}: column '{shown(column)}' of {meaning} is not there; {there}")
    ending = column.rpartition("_")[2] if "_" in column else ""
    stated = (
        COVERAGE.sub("", content.units.get(column, ""))
        or unit_in(COVERAGE.sub("", column))
        or (ending if _plain(ending) in UNITS[meaning] else "")
    )
    known = UNITS[meaning]
    unit = _plain(given or stated)
    if meaning == "magnitude":  # output in any unit per g, unless it is said to be a level, or per m/s²
        if _per(given or stated or column) == "m/s^2":
            return PER_M_S2
        if given and _per(stated or column) == "m/s^2":
            raise WrongUse(
                f"{where}: column '{shown(column)}' states a unit per m/s², --unit-of {meaning}={shown(given)} has "
                "none; leave it out, or write the whole unit"
            )
        if unit.lower().startswith(IN_DECIBEL.lower()):
            return IN_DECIBEL
        if given and not (output_unit(given) or _per(given) == "g" or given == "1"):
            raise WrongUse(f"import: --unit-of magnitude={shown(given)}: unknown; write V/g, mV/(m/s^2) or dB")
        return LINEAR
    if unit not in known:
        what = f"unit '{shown(given or stated)}'" if given or stated else "no unit"
        raise DataRejected(
            f"{where}: column '{shown(column)}' has {what}, one of {', '.join(known)} is needed; add --unit-of {meaning}=…"
        )
    return unit


def _per(unit: str) -> str:
    """The unit of acceleration per which a unit, or the name of a column, is at its end; empty for none."""
    per = PER.search(unit)
    return output_unit(per[1]) if per else ""


def output_of(content: Content, layout: PointsLayout) -> str:
    """The unit of the output of points, such as ``mV`` of mV/(m/s²); empty where none is stated, or another than of an output."""
    column = _columns(content.table, layout).get("magnitude", "")
    bracketed = re.search(r"[\[(](.+)[\])]$", column.strip())
    stated = layout.units.get("magnitude", "") or content.units.get(column, "") or (bracketed[1] if bracketed else "")
    return output_unit(PER.sub("", stated))


def _plain(unit: str) -> str:
    """A unit as :data:`UNITS` spells it; an unknown unit unchanged."""
    return ALIKE.get(unit.strip().lower(), unit.strip())


def _values(table: pd.DataFrame, column: str, where: str, meaning: str, unit: str) -> Array:
    """A column in the unit of the points."""
    value = finite_column(table, column, where, "correct the row") * UNITS[meaning][unit]
    if meaning == "magnitude" and unit == IN_DECIBEL:
        return np.exp(value)
    if _lags(meaning, column):
        return -value
    if meaning != "phase":
        advice = "a magnitude in dB needs --unit-of magnitude=dB" if meaning == "magnitude" else "correct the row"
        _refuse_not_positive(value, column, where, advice)
    return value


def _refuse_not_positive(value: Array, column: str, where: str, advice: str = "correct the row") -> None:
    if not np.all(value > 0.0):
        row = int(np.flatnonzero(~(value > 0.0))[0]) + 1
        raise DataRejected(f"{where}: row {row}, column {shown(column)}: a value above 0 is needed; {advice}")
