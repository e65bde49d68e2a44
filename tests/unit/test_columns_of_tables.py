"""The quick look at a table's columns, and the conversion of one that fails it, against a library of table contracts."""

from typing import Any

import numpy as np
import pandas as pd
import pandera.pandas as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schemas import table_check, tables
from schemas.columns import Seen, all_different
from schemas.errors import DataRejected
from schemas.table import Table

GOOD = pd.DataFrame(
    {
        "unit": ["A1", "A1", "B2"],
        "axis": ["x", "y", "x"],
        "row": [0, 0, 1],
        "column": [0, 1, 1],
        "value": [1.0, 2.0, 3.0],
    }
)


def peer(table: Table) -> pa.DataFrameSchema:
    """The same contract in the notation of another library."""
    columns: dict[str, pa.Column] = {}
    for name, column in table.columns.items():
        checks = [pa.Check.ge(column.low)] if column.low is not None else []
        checks += [pa.Check.isin(list(column.allowed))] if column.allowed else []
        checks += [pa.Check.str_length(min_value=1)] if column.filled else []
        columns[name] = pa.Column(str if column.kind == "str" else column.kind, checks, nullable=column.missing)
    return pa.DataFrameSchema(columns, strict=False, coerce=True)


def right(frame: pd.DataFrame) -> bool:
    return table_check._plainly_right(tables.TABLES["covariance"], frame)


def test_a_good_table_is_right_at_the_first_look() -> None:
    assert right(GOOD)
    assert right(GOOD.iloc[:0])


@pytest.mark.parametrize(
    "change",
    [
        {"unit": ["A1", "A1", ""]},
        {"axis": ["x", "y", "w"]},
        {"row": [0, 0, -1]},
        {"row": [0.0, 0.0, 1.0]},
        {"value": [1.0, 2.0, np.nan]},
        {"value": [1.0, np.inf, 3.0]},
        {"value": ["1", "2", "3"]},
        {"unit": ["A1", "A1", None]},
        {"axis": ["x", "x", "x"], "row": [0, 0, 0], "column": [1, 1, 1]},
    ],
)
def test_a_table_with_one_thing_amiss_is_looked_at_again(change: dict[str, Any]) -> None:
    assert not right(GOOD.assign(**change))


TEXTS, WHOLE = st.sampled_from(["", "a", "b", "c"]), st.integers(-(2**63), 2**63 - 1) | st.integers(0, 2)
NUMBERS = st.sampled_from([0.0, 0.5, 1.0, float("nan")])


@given(st.lists(st.tuples(TEXTS, WHOLE, NUMBERS, st.booleans()), max_size=12))
def test_rows_said_to_be_different_are(rows: list[tuple[str, int, float, bool]]) -> None:
    frame = pd.DataFrame(rows, columns=["text", "whole", "number", "flag"]).astype(
        {"text": "str", "whole": "int64", "number": "float64", "flag": "bool"}
    )
    for names in (["text"], ["whole"], ["text", "number"], ["flag", "text", "whole", "number"]):
        said = all_different([Seen.of(frame[name]) for name in names])
        spread = int(frame["whole"].max()) - int(frame["whole"].min()) if len(frame) else 0
        if "whole" in names and spread > 2**50:  # too many to number: then it is not said
            assert not (said and frame.duplicated(names).any())
        else:
            assert said == (not frame.duplicated(names).any())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"unit": ["A1", "A1", ""]}, "row 7 (unit ), column unit: found nothing, a text is needed"),
        ({"axis": ["x", "y", "w"]}, "row 7 (unit B2), column axis: found w, one of x, y, z is needed"),
        ({"row": [0, 0, -1]}, "row 7 (unit B2), column row: found -1, a whole number of at least 0 is needed"),
        ({"row": [0.0, 0.5, 1.0]}, "row 6 (unit A1), column row: found 0.5, a whole number of at least 0 is needed"),
        ({"row": [0, np.nan, 1]}, "row 6 (unit A1), column row: found nan, a whole number of at least 0 is needed"),
        ({"row": ["0", "two", "1"]}, "row 6 (unit A1), column row: found two, a whole number of at least 0 is needed"),
        ({"row": [2.0**63, 0.0, 1.0]}, "row 5 (unit A1), column row: found 9.223372036854776e+18, a whole number"),
    ],
)
def test_the_first_wrong_value_is_named_with_its_row_and_what_is_needed(change: dict[str, Any], message: str) -> None:
    with pytest.raises(DataRejected) as refused:
        table_check.check("covariance", GOOD.assign(**change).set_axis([5, 6, 7]))
    assert message in str(refused.value)


def test_values_of_another_type_are_converted() -> None:
    texts = GOOD.assign(row=["0", "0", "1"], column=[0.0, 1.0, 1.0], value=["1", "2", "3"], unit=["1", "1", "2"])
    assert table_check.check("covariance", texts).equals(GOOD.assign(unit=["1", "1", "2"]))


ODD = st.sampled_from(["A1", "", "x", "w"])


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(ODD, ODD, st.integers(-1, 3), st.sampled_from([0.0, 1.5, float("nan")])), min_size=1, max_size=6
    ),
    st.sampled_from(["int64", "float64", "str", "object"]),
)
def test_what_is_accepted_another_library_accepts(rows: list[tuple[str, str, int, float]], kind: str) -> None:
    frame = pd.DataFrame(rows, columns=["unit", "axis", "row", "value"]).assign(column=np.arange(len(rows)))
    frame = frame.astype({"unit": "str", "axis": "str", "row": kind, "column": "int64"})
    try:
        expected = peer(tables.TABLES["covariance"]).validate(frame)
    except pa.errors.SchemaError:
        expected = None
    if not np.isfinite(frame["value"]).all() or frame.duplicated(["unit", "axis", "row", "column"]).any():
        expected = None
    assert right(frame) == (expected is not None and kind == "int64")
    if expected is None:
        with pytest.raises(DataRejected):
            table_check.check("covariance", frame)
    else:
        assert table_check.check("covariance", frame).equals(expected)
