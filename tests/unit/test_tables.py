"""Contracts of tables: every refusal names unit, row and what is needed."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas import table_check, tables
from schemas.errors import DataRejected


def dwells(**changes: object) -> pd.DataFrame:
    base = {"unit": ["A1", "A2"], "dwell": [0, 0], "time_s": [1.0, 1.0]}
    outputs = {f"out_{axis}": [0.1, 0.2] for axis in "xyz"}
    return pd.DataFrame({**base, **outputs, **changes})


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["out_x", "time_s", "unit_C"])
def test_refuses_what_is_not_finite_and_names_unit_and_row(bad: float, column: str) -> None:
    with pytest.raises(DataRejected, match=rf"row 1 \(unit A2\), column {column}: found {bad}"):
        table_check.check("dwells", dwells(**{column: [1.0, bad]}))


def test_refuses_a_unit_that_is_there_twice() -> None:
    with pytest.raises(DataRejected, match="unit A1, dwell 0 is there twice"):
        table_check.check("dwells", dwells(unit=["A1", "A1"]))


def test_names_a_missing_column_and_those_that_are_there() -> None:
    with pytest.raises(DataRejected, match="column out_z is missing, found unit, dwell"):
        table_check.check("dwells", dwells().drop(columns="out_z"))


def test_refuses_words_where_numbers_are_needed() -> None:
    with pytest.raises(DataRejected, match="found many"):
        table_check.check("dwells", dwells(out_y=[1.0, "many"]))


def test_refuses_a_unit_of_output_that_it_does_not_know() -> None:
    frame = pd.DataFrame(
        {"unit": ["A"], "slot": [0], "outcome": ["good"], "grade": [""], "reasons": [""], "rule": [""]}
    )
    with pytest.raises(DataRejected, match=r"row 0 \(unit A\), column outcome: found good"):
        table_check.check("grades", frame)


def test_keeps_columns_that_it_does_not_know() -> None:
    assert "humidity_pct" in table_check.check("dwells", dwells(humidity_pct=[40.0, 41.0]))


def test_readings_of_a_silent_unit_may_have_gaps() -> None:
    table = tables.TABLES["readings"]
    assert table.only_ok


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=2))
def test_leaves_finite_numbers_as_they_are(values: list[float]) -> None:
    assert table_check.check("dwells", dwells(out_x=values))["out_x"].tolist() == values
