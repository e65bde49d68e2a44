"""Recorded quantities: what a station notes beside the outputs of every dwell. One row each; every list of them follows.

A quantity with an ``attribute`` is an array of :class:`inertial.state.State` of that name. One without is a covariate: a recorded
column that effects and formulas call by its name. A column that has no row here is a covariate, too; a row adds its label, its
unit and a usual value.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from inertial.arrays import Array

Joined = Literal["mean", "max"]

LARGEST = 1e30
"""Of any number in a file: its square, and sums of such squares, are still numbers."""
LARGEST_TIME_S = 1e11
"""Seconds on a clock: the year 5138 of Unix time."""
_KELVIN_0_C, _HOTTEST_C = -273.15, 2000.0
_MANY_TURNS_DEG = 1e6  # an encoder may count on over many turns


@dataclass(frozen=True)
class Varied:
    """How a plan that leaves a quantity alone is changed so that its effects are seen.

    steady : share of its largest value within which the quantity is constant
    feature : what a plan is said to have in which it is
    factor : by which it is raised in every second dwell of a repetition
    cure : the change as an instruction
    """

    steady: float
    feature: str
    factor: float
    cure: str


@dataclass(frozen=True)
class Quantity:
    """A recorded quantity.

    column : of the tables and of the exchange format
    attribute : of the state; empty for a covariate
    unit : of the column
    label : for pictures, without the unit
    factor : state = factor · column
    once : whether a unit has one value for all its dwells (its slot)
    driver : whether a dependence of the residuals on it is looked for
    formula : name in formulas beside the column's own; empty where there is none
    formula_factor, meaning : value in a formula = factor · state; what it is, for people
    column_meaning : of the column's own name in formulas, which has the state's value
    mapped : name in the mapping of a foreign file; empty where it is not asked for
    clock : whether it only grows with time: it is followed by a curve, never by levels
    shown : factor and unit in pictures, where they are not the column's
    joined : how the values of neighbouring dwells become one
    lowest, highest : where values of the column can lie; anything else in a file is a slip
    usual, spread : a value that a plan may take for granted, and how far it wanders about it on a station
    varied : how a plan varies it that leaves it to the station; None where its steps set it
    reading : position among the columns that every station reads beside its records; 0 where not every station does
    """

    column: str
    attribute: str
    unit: str
    label: str
    factor: float = 1.0
    once: bool = False
    driver: bool = True
    formula: str = ""
    formula_factor: float = 1.0
    meaning: str = ""
    column_meaning: str = "the same"
    mapped: str = ""
    clock: bool = False
    shown: tuple[float, str] | None = None
    joined: Joined = "mean"
    usual: float = 0.0
    spread: float = 0.0
    varied: Varied | None = None
    reading: int = 0
    lowest: float = -LARGEST
    highest: float = LARGEST

    def about(self, wander: Array) -> Array:
        """Values about the usual one, and above it where none can be negative, for standard normal numbers; column's unit."""
        return self.usual + self.spread * (wander if self.lowest < 0.0 else np.abs(wander))

    @property
    def axis_label(self) -> str:
        """Label and unit for the axis of a picture."""
        return f"{self.label} / {self.unit if self.shown is None else self.shown[1]}"


HOURS = (1.0 / 3600.0, "h")

RECORDED: tuple[Quantity, ...] = (
    Quantity(
        "unit_C", "temperature", "°C", "temperature of the unit",
        formula="temperature", meaning="temperature of the sensor, °C", mapped="temperature", usual=25.0, reading=2,
        lowest=_KELVIN_0_C, highest=_HOTTEST_C,
    ),
    Quantity(
        "chamber_C", "chamber", "°C", "temperature of the chamber",
        formula="chamber", meaning="temperature of the chamber, °C", mapped="chamber", usual=25.0, reading=1,
        lowest=_KELVIN_0_C, highest=_HOTTEST_C,
    ),
    Quantity(
        "time_s", "time", "s", "time", clock=True, shown=HOURS,
        formula="hours", formula_factor=1.0 / 3600.0, meaning="time since the run began, h", column_meaning="the same, s",
        lowest=-LARGEST_TIME_S, highest=LARGEST_TIME_S,
    ),
    Quantity(
        "since_move_s", "since_move", "s", "time since the last move",
        formula="since_move", meaning="time since the table last moved, s", mapped="since_move", usual=2.0, reading=5,
        lowest=0.0, highest=LARGEST_TIME_S,
    ),
    Quantity(
        "since_power_s", "since_power", "s", "time since power-on", clock=True, shown=HOURS,
        formula="since_power", meaning="time since power-on, s", mapped="since_power", usual=600.0, reading=6,
        lowest=0.0, highest=LARGEST_TIME_S,
    ),
    Quantity(
        "supply_V", "supply", "V", "supply",
        formula="supply", meaning="supply, V", mapped="supply", usual=3.3, spread=1e-3, reading=3,
        varied=Varied(0.005, "a constant supply voltage", 1.02, "step the supply voltage at constant temperature"),
    ),
    Quantity(
        "vibration_g", "vibration", "g rms", "vibration",
        formula="vibration", meaning="vibration, g rms", mapped="vibration", usual=1e-3, spread=1e-4, reading=4,
        varied=Varied(0.9, "constant vibration", 10.0, "measure with the compressor on and off"), lowest=0.0,
    ),
    # of runs that switch their devices off and on: it tells apart what a power-on changes, and is no driver by itself
    Quantity(
        "power_off_s", "power_off", "s", "time without power", driver=False, joined="max",
        mapped="power_off", lowest=0.0, highest=LARGEST_TIME_S,
    ),
    Quantity(
        "outer_deg", "outer", "°", "outer angle", factor=math.pi / 180.0, driver=False, mapped="outer",
        lowest=-_MANY_TURNS_DEG, highest=_MANY_TURNS_DEG,
    ),
    Quantity(
        "inner_deg", "inner", "°", "inner angle", factor=math.pi / 180.0, driver=False, mapped="inner",
        lowest=-_MANY_TURNS_DEG, highest=_MANY_TURNS_DEG,
    ),
    # of units that are put down by hand: where the table is not level, the error turns with the heading
    Quantity(
        "heading_deg", "heading", "°", "heading of the placement", factor=math.pi / 180.0, driver=False, mapped="heading",
        lowest=-_MANY_TURNS_DEG, highest=_MANY_TURNS_DEG,
    ),
    Quantity("slot", "slot", "", "slot", once=True, driver=False, mapped="slot", lowest=0.0, highest=2.0**53),
    Quantity("humidity_pct", "", "% RH", "relative humidity", usual=45.0, spread=3.0),
    Quantity("pressure_hPa", "", "hPa", "air pressure", usual=1013.0, spread=3.0),
)  # fmt: skip
"""In the order in which drivers and formulas are listed."""

BY_COLUMN: Mapping[str, Quantity] = MappingProxyType({row.column: row for row in RECORDED})
BY_ATTRIBUTE: Mapping[str, Quantity] = MappingProxyType({row.attribute: row for row in RECORDED if row.attribute})
LEFT_ALONE: tuple[Quantity, ...] = tuple(row for row in RECORDED if row.attribute and row.varied)
"""Quantities of the state that the steps of a plan do not set."""
READINGS: tuple[str, ...] = tuple(row.column for row in sorted(RECORDED, key=lambda row: row.reading) if row.reading)
"""Columns that every station reads beside its records, in their order."""


@dataclass(frozen=True)
class Derived:
    """A quantity that follows from recorded ones.

    name : as a driver; attribute : of the state; column : that it follows from; the rest as of :class:`Quantity`
    """

    name: str
    attribute: str
    column: str
    unit: str
    label: str
    formula: str
    meaning: str
    driver: bool = True

    @property
    def axis_label(self) -> str:
        """Label and unit for the axis of a picture."""
        return f"{self.label} / {self.unit}"


DERIVED: tuple[Derived, ...] = (
    Derived("theta", "theta", "unit_C", "K", "temperature above 25 °C", "theta", "temperature above 25 °C, K", False),
    Derived(
        "temperature_rate", "temperature_rate", "unit_C", "K/min", "rate of temperature", "rate",
        "rate of temperature, K/min",
    ),
)  # fmt: skip

OUTPUT_COLUMNS = ("out_x", "out_y", "out_z")
SPREAD_COLUMNS = ("sd_x", "sd_y", "sd_z")
SLOW_COLUMNS = ("slow_sd_x", "slow_sd_y", "slow_sd_z")
"""Standard deviation of white noise that is as loud as the slow part of the samples: over √n the error of their mean."""
FORCE_COLUMNS = ("force_x", "force_y", "force_z")
ANGLE_COLUMNS = ("outer_deg", "inner_deg")
BOOKKEEPING = (
    *("unit", "dwell", "record", "kind", "pose", "soak", "status", "out_unit", "n", "overflow"),
    *("start_s", "duration_s", "rate_hz", "full_scale", "outer_command_deg", "inner_command_deg"),
)
"""Columns that say which dwell it is and how it was taken."""
KNOWN_COLUMNS = frozenset(
    (
        *BOOKKEEPING,
        *OUTPUT_COLUMNS,
        *SPREAD_COLUMNS,
        *SLOW_COLUMNS,
        *FORCE_COLUMNS,
        *(row.column for row in RECORDED if row.attribute),
    )
)
"""Columns with a meaning of their own; every other column of numbers is a covariate."""


def is_covariate(column: str) -> bool:
    """Whether a recorded column of numbers is a covariate."""
    return column not in KNOWN_COLUMNS


def attribute_drivers() -> dict[str, str]:
    """Names of the drivers that every lot may have, with the state's attribute of each; a derived one follows its source."""
    attributes: dict[str, str] = {}
    for row in RECORDED:
        if row.driver and row.attribute:
            attributes[row.column] = row.attribute
        attributes |= {item.name: item.attribute for item in DERIVED if item.driver and item.column == row.column}
    return attributes


def is_clock(driver: str) -> bool:
    """Whether a driver only grows with time."""
    return driver in BY_COLUMN and BY_COLUMN[driver].clock


def axis_labels() -> dict[str, str]:
    """Labels with units of drivers, for the axes of pictures."""
    return {row.column: row.axis_label for row in RECORDED} | {row.name: row.axis_label for row in DERIVED}


def shown_factor(driver: str) -> float:
    """Factor from a driver's values in the state to those of its picture."""
    row = BY_COLUMN.get(driver)
    return 1.0 if row is None or row.shown is None else row.shown[0]


def formula_names() -> dict[str, tuple[str, float, str]]:
    """Names in formulas: the state's attribute, the factor, what it is."""
    names: dict[str, tuple[str, float, str]] = {}
    for row in RECORDED:
        if row.formula:
            names[row.formula] = (row.attribute, row.formula_factor, row.meaning)
            names[row.column] = (row.attribute, 1.0, row.column_meaning)
        names |= {item.formula: (item.attribute, 1.0, item.meaning) for item in DERIVED if item.column == row.column}
    return names


def formula_name(driver: str) -> str:
    """What a formula calls a driver; the driver's own name where there is no other."""
    names = {row.name: row.formula for row in DERIVED} | {row.column: row.formula for row in RECORDED if row.formula}
    return names.get(driver, driver)


def column_of(quantity: str) -> str:
    """The column to record for a quantity that an effect lacks, by the name that it asked for."""
    name = quantity.split(" ", maxsplit=1)[0]
    if name in BY_ATTRIBUTE:
        return BY_ATTRIBUTE[name].column
    return next((row.column for row in DERIVED if name == row.attribute), quantity)
