"""The contract of a column against what is meant by it, row by row."""

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schemas import table_check
from schemas.columns import Column, WrongValues
from schemas.errors import DataRejected

GOOD = pd.DataFrame(
    {
        "unit": ["A1", "A1", "B2"],
        "axis": ["x", "y", "x"],
        "row": [0, 0, 1],
        "column": [0, 1, 1],
        "value": [1.0, 2.0, 3.0],
    }
)


def right(frame: pd.DataFrame) -> bool:
    try:
        table_check.check("covariance", frame)
    except DataRejected:
        return False
    return True


def test_a_good_table_comes_back_as_it_is() -> None:
    assert table_check.check("covariance", GOOD) is GOOD
    assert right(GOOD.iloc[:0])


@pytest.mark.parametrize(
    "change",
    [
        {"unit": ["A1", "A1", ""]},
        {"axis": ["x", "y", "w"]},
        {"row": [0, 0, -1]},
        {"row": [0.0, 0.0, 1.5]},
        {"value": [1.0, 2.0, np.nan]},
        {"value": [1.0, np.inf, 3.0]},
        {"value": ["1", "2", "three"]},
        {"unit": ["A1", "A1", None]},
        {"axis": ["x", "x", "x"], "row": [0, 0, 0], "column": [1, 1, 1]},
    ],
)
def test_a_table_with_one_wrong_value_is_refused(change: dict[str, Any]) -> None:
    assert not right(GOOD.assign(**change))


def test_values_of_another_type_are_converted() -> None:
    mixed = pd.DataFrame({"unit": [7, 8], "axis": ["x", "y"], "row": [0.0, 1.0], "column": ["0", "1"], "value": [1, 2]})
    found = table_check.check("covariance", mixed)
    assert found["unit"].tolist() == ["7", "8"]
    assert [str(found[name].dtype) for name in ("row", "column", "value")] == ["int64", "int64", "float64"]


def is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def meant(column: Column, value: Any) -> bool:
    """Whether a value may stand in a column, in plain words."""
    if column.kind == "flag":
        return value in {True, False} if isinstance(value, bool | int | float) else False
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return column.missing
    if column.kind == "text":
        text = value if isinstance(value, str) else str(value)
        return text in column.allowed if column.allowed else bool(text) or column.empty
    if not is_number(value):
        return False
    number = float(value)
    fits = (math.isfinite(number) or (column.missing and column.kind == "number")) and not (
        column.low is not None and number < column.low
    )
    return fits and (column.kind == "number" or number == math.floor(number))


COLUMNS = st.one_of(
    st.builds(
        Column,
        st.just("text"),
        allowed=st.sampled_from([(), ("x", "y")]),
        empty=st.booleans(),
        missing=st.booleans(),
    ).filter(lambda one: not (one.allowed and one.empty)),
    st.builds(Column, st.just("number"), low=st.sampled_from([None, 0.0]), missing=st.booleans()),
    st.builds(Column, st.just("whole"), low=st.sampled_from([None, 0.0, -1.0])),
    st.just(Column("flag")),
)
TEXTS = st.lists(st.sampled_from(["", "x", "w", "1.5", None]), min_size=1, max_size=6)
NUMBERS = st.lists(st.sampled_from([0.0, 1.0, -1.0, 1.5, float("nan"), float("inf")]), min_size=1, max_size=6)
WHOLES = st.lists(st.integers(-2, 3), min_size=1, max_size=6)
FLAGS = st.lists(st.booleans(), min_size=1, max_size=6)


@settings(deadline=None)
@given(COLUMNS, st.one_of(TEXTS, NUMBERS, WHOLES, FLAGS))
def test_the_rows_that_a_column_refuses_are_those_that_are_not_meant(column: Column, values: list[Any]) -> None:
    series = pd.Series(values, dtype="str") if isinstance(values[0], str | None) else pd.Series(values)
    converted = column.converted(series)
    wrong = converted if isinstance(converted, WrongValues) else column.wrong(converted)
    expected = [not meant(column, None if value is None else value) for value in series.tolist()]
    if wrong is None:
        assert not any(expected)
    else:
        assert any(wrong.rows)
        assert all(there for refused, there in zip(wrong.rows, expected, strict=True) if refused)
