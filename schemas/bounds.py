"""Types of numbers in files with generous bounds: a value outside is a typing error, or would need unlimited time."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, FiniteFloat, ValidationInfo

DAY_S = 86400.0
LONGEST_WAIT_S = 31 * DAY_S
"""Longest wait, record or time limit."""
LONGEST_RUN_S = 366 * DAY_S
"""Longest run of a recipe."""
COLDEST_C, HOTTEST_C = -200.0, 400.0
"""From liquid nitrogen to the hottest commercial devices."""
LARGEST_TIME_S = 1e11
"""Largest time on a clock: the year 5138 of Unix time."""
LARGEST = 1e15
"""Largest number without a narrower bound: its fourth power is still a finite number."""
FASTEST_HZ = 1e6
MOST_POSES = 10_000
MOST_SOAKS = 1_000
MOST_UNITS = 10_000
LONGEST_NAME = 64
LONGEST_TEXT = 10_000
LARGEST_SEED = 2**63 - 1


def unquoted(value: Any, info: ValidationInfo) -> Any:
    """A value without a text, which pydantic would take for the number in it; of a command line every value is a text."""
    for each in value if isinstance(value, (list, tuple)) else ():
        unquoted(each, info)
    if isinstance(value, str) and info.mode == "python":
        raise ValueError("a text, a number without quotes is needed; correct it")
    return value


def _refuse_flag(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, bool):
        raise ValueError("true and false are not numbers, a number is needed; give one")  # noqa: TRY004 - pydantic reports a ValueError with its key
    return unquoted(value, info)


_NotFlag = BeforeValidator(_refuse_flag)
Number = Annotated[FiniteFloat, Field(ge=-LARGEST, le=LARGEST), _NotFlag]
Positive = Annotated[FiniteFloat, Field(gt=0.0, le=LARGEST), _NotFlag]
NotNegative = Annotated[FiniteFloat, Field(ge=0.0, le=LARGEST), _NotFlag]
Seconds = Annotated[FiniteFloat, Field(gt=0.0, le=LONGEST_WAIT_S), _NotFlag]
Wait = Annotated[FiniteFloat, Field(ge=0.0, le=LONGEST_WAIT_S), _NotFlag]
Celsius = Annotated[FiniteFloat, Field(ge=COLDEST_C, le=HOTTEST_C), _NotFlag]
Degrees = Annotated[FiniteFloat, Field(ge=-3600.0, le=3600.0), _NotFlag]
Rate = Annotated[FiniteFloat, Field(gt=0.0, le=FASTEST_HZ), _NotFlag]
Seed = Annotated[int, Field(ge=0, le=LARGEST_SEED), _NotFlag]
Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]
"""A name that is used as the name of a file or folder."""
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
