"""Numbers of files with the bounds that no sensible file leaves: what lies beyond is a slip, or would never come to an end."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, FiniteFloat

DAY_S = 86400.0
LONGEST_WAIT_S = 31 * DAY_S
"""A wait, a record or a limit of patience."""
LONGEST_RUN_S = 366 * DAY_S
"""All that a recipe asks for."""
COLDEST_C, HOTTEST_C = -200.0, 400.0
"""Liquid nitrogen to the hottest devices that are sold."""
LARGEST_TIME_S = 1e11
"""Seconds on a clock: the year 5138 of Unix time."""
LARGEST = 1e15
"""Of a number that has no narrower bound: its fourth power is still one."""
FASTEST_HZ = 1e6
MOST_POSES = 10_000
MOST_SOAKS = 1_000
MOST_UNITS = 10_000
LONGEST_NAME = 64
LONGEST_TEXT = 10_000
LARGEST_SEED = 2**63 - 1


def _no_flag(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("true and false are no numbers; give a number")  # noqa: TRY004 - pydantic reports a ValueError with its key
    return value


_Plain = BeforeValidator(_no_flag)
Number = Annotated[FiniteFloat, Field(ge=-LARGEST, le=LARGEST), _Plain]
Positive = Annotated[FiniteFloat, Field(gt=0.0, le=LARGEST), _Plain]
NotNegative = Annotated[FiniteFloat, Field(ge=0.0, le=LARGEST), _Plain]
Seconds = Annotated[FiniteFloat, Field(gt=0.0, le=LONGEST_WAIT_S), _Plain]
Wait = Annotated[FiniteFloat, Field(ge=0.0, le=LONGEST_WAIT_S), _Plain]
Celsius = Annotated[FiniteFloat, Field(ge=COLDEST_C, le=HOTTEST_C), _Plain]
Degrees = Annotated[FiniteFloat, Field(ge=-3600.0, le=3600.0), _Plain]
Rate = Annotated[FiniteFloat, Field(gt=0.0, le=FASTEST_HZ), _Plain]
Seed = Annotated[int, Field(ge=0, le=LARGEST_SEED), _Plain]
Count = Annotated[int, Field(ge=1, le=10**9), _Plain]
Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]
"""A name that becomes a file's or a folder's."""
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
