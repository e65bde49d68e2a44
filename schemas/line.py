"""The file of a line: fixtures, what they share, who loads them and when, and the lots that are to go through it."""

import math
import re
from collections.abc import Sequence
from typing import Annotated

from pydantic import BeforeValidator, Field, field_validator, model_validator

from schemas.bounds import DAY_S, Name, NotNegative, Positive, Text
from schemas.errors import did_you_mean
from schemas.station_devices import Equipment
from schemas.strict import Strict, refuse_repeated

MOST_FIXTURES = 20
MOST_LOTS = 100
DAY_MIN = DAY_S / 60.0
OPERATOR, FIXTURES = "operator", "fixtures"
"""What a schedule calls those who load and the seats of the lots."""
NEEDS = ("soak", "measure", "static", *(role for role in Equipment.model_fields if role != "built_in"))
"""What a lot may need a shared resource for: parts of its recipe, or the equipment of procedures by its role."""

_CLOCK = re.compile(r"([01]?\d|2[0-4]):([0-5]\d)")


def minutes_of(clock: str) -> float:
    """Minutes since midnight of a time of day. Raises ValueError: it is none."""
    match = _CLOCK.fullmatch(clock.strip())
    if match is None or (minutes := 60.0 * int(match[1]) + int(match[2])) > DAY_MIN:
        raise ValueError("a time of day as 06:00 is needed; correct it")
    return minutes


def _clock(given: object) -> float:
    """Minutes since midnight of a time of day, or of hours as a number."""
    hours = 60.0 * given if isinstance(given, int | float) and not isinstance(given, bool) else math.nan
    minutes = minutes_of(given) if isinstance(given, str) else hours
    if not 0.0 <= minutes < DAY_MIN:  # not a number fails this, too
        raise ValueError("a time of day as 06:00 or hours from 0 to below 24 are needed; correct it")
    return minutes


def _shift(given: object) -> tuple[float, float]:
    """A shift as its begin and end in minutes since midnight; one over midnight ends on the next day."""
    begin, dash, end = given.partition("-") if isinstance(given, str) else ("", "", "")
    if not dash:
        raise ValueError("begin and end as 06:00-14:00 are needed; correct it")
    first, last = minutes_of(begin), minutes_of(end)
    return (first, last if last > first else last + DAY_MIN)


def staffed(shifts: Sequence[tuple[float, float]]) -> float:
    """Part of the day in which there is a shift, 0 to 1; shifts that overlap count once, and none is round the clock."""
    spans = sorted(part for begin, end in shifts for part in _within_a_day(begin, end))
    until = total = 0.0
    for begin, end in spans:
        total += max(0.0, end - max(begin, until))
        until = max(until, end)
    return total / DAY_MIN if shifts else 1.0


def _within_a_day(begin: float, end: float) -> list[tuple[float, float]]:
    """A shift in parts that do not go over midnight."""
    return [(begin, min(end, DAY_MIN)), (max(begin, DAY_MIN) - DAY_MIN, max(end, DAY_MIN) - DAY_MIN)]


Shift = Annotated[tuple[float, float], BeforeValidator(_shift)]
Clock = Annotated[float, BeforeValidator(_clock)]
Count = Annotated[int, Field(ge=1, le=MOST_LOTS)]


class Shared(Strict):
    """Equipment that the fixtures share.

    ``change_min`` goes by before each stay of a lot on it, at the temperature of the lot; ``by_hand``: an operator does it.
    """

    name: Name
    needed_for: Annotated[list[Name], Field(min_length=1)]
    count: Count = 1
    change_min: NotNegative = 0.0
    by_hand: bool = False

    @field_validator("needed_for")
    @classmethod
    def _known(cls, values: list[str]) -> list[str]:
        for unknown in (value for value in values if value not in NEEDS):
            raise ValueError(f"found '{unknown}'; {did_you_mean(unknown, NEEDS)}")
        return values


class Operators(Strict):
    """Who loads, unloads and changes: how many at a time, in which shifts of each day; always where there are no shifts."""

    count: Count = 1
    shifts: list[Shift] = []


class LineLots(Strict):
    """Lots of one recipe."""

    recipe: Text
    count: Count = 1


class Line(Strict):
    """A line: fixtures with a chamber each, what they share, operators, and lots in any order."""

    name: Name
    station: Text = ""
    fixtures: Annotated[list[Name], Field(min_length=1, max_length=MOST_FIXTURES)]
    load_min: Positive
    unload_min: Positive
    longest_wait_min: NotNegative = 60.0
    start: Clock = 0.0
    operators: Operators = Operators()
    shared: list[Shared] = []
    lots: Annotated[list[LineLots], Field(min_length=1)]

    @model_validator(mode="after")
    def _possible(self) -> "Line":
        refuse_repeated(self.fixtures, "fixtures: ", "give each its own name")
        refuse_repeated([resource.name for resource in self.shared], "shared: ", "give each its own name")
        for taken in (resource.name for resource in self.shared if resource.name in {OPERATOR, FIXTURES}):
            raise ValueError(f"shared: found the name '{taken}', which a schedule has for its own; choose another name")
        if (count := sum(lot.count for lot in self.lots)) > MOST_LOTS:
            raise ValueError(f"lots: {count} lots, at most {MOST_LOTS} are planned at once; plan fewer")
        by_hand = {"load_min": self.load_min, "unload_min": self.unload_min}
        by_hand |= {
            f"change_min of {resource.name}": resource.change_min for resource in self.shared if resource.by_hand
        }
        longest = max((end - begin for begin, end in self.operators.shifts), default=DAY_MIN)
        for key, minutes in by_hand.items():
            if minutes > longest:
                raise ValueError(f"{key}: {minutes:g} min, the longest shift has {longest:g} min; lengthen the shift")
        return self
