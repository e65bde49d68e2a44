"""Contracts of tables: every refusal names unit, row and what is needed; the quick look against the schema."""

import numpy as np
import pandas as pd
import pytest
from each import each
from hypothesis import given, settings
from hypothesis import strategies as st
from pandera.errors import SchemaError

from schemas import table_check, tables
from schemas.errors import DataRejected


def dwells(**changes: object) -> pd.DataFrame:
    base = {"unit": ["A1", "A2"], "dwell": [0, 0], "time_s": [1.0, 1.0]}
    outputs = {f"out_{axis}": [0.1, 0.2] for axis in "xyz"}
    return pd.DataFrame({**base, **outputs, **changes})


REFUSED = [
    *(({column: [1.0, bad]}, rf"row 2 \(unit A2\), column {column}: found {bad}")
      for bad in (np.nan, np.inf, -np.inf) for column in ("out_x", "time_s", "unit_C")),
    ({"unit": ["A1", "A1"]}, "unit A1, dwell 0 is there twice"),
    ({"out_y": [1.0, "many"]}, "found many"),
]  # fmt: skip


@each(REFUSED)
def test_a_refusal_names_unit_row_and_what_is_needed(row) -> None:
    with pytest.raises(DataRejected, match=row[1]):
        table_check.check("dwells", dwells(**row[0]))


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=2))
def test_leaves_finite_numbers_as_they_are(values: list[float]) -> None:
    checked = table_check.check("dwells", dwells(out_x=values, humidity_pct=[40.0, 41.0]))
    assert checked["out_x"].tolist() == values
    assert "humidity_pct" in checked  # a column that it does not know


GOOD = pd.DataFrame(
    {"unit": ["A1", "A1", "B2"], "axis": list("xyx"), "row": [0, 0, 1], "column": [0, 1, 1], "value": [1.0, 2.0, 3.0]}
)
AMISS = [
    {"unit": ["A1", "A1", ""]}, {"axis": ["x", "y", "w"]}, {"row": [0, 0, -1]}, {"row": [0.0, 0.0, 1.0]},
    {"value": [1.0, 2.0, np.nan]}, {"value": [1.0, np.inf, 3.0]}, {"value": ["1", "2", "3"]}, {"unit": ["A1", "A1", None]},
    {"axis": ["x", "x", "x"], "row": [0, 0, 0], "column": [1, 1, 1]},
]  # fmt: skip


def right(frame: pd.DataFrame) -> bool:
    return table_check._plainly_right(tables.TABLES["covariance"], frame)


def test_a_table_is_right_at_the_first_look_unless_one_thing_is_amiss() -> None:
    assert [right(GOOD), right(GOOD.iloc[:0])] == [True, True]
    assert [change for change in AMISS if right(GOOD.assign(**change))] == []


TEXTS, WHOLE = st.sampled_from(["", "a", "b", "c"]), st.integers(-(2**63), 2**63 - 1) | st.integers(0, 2)
NUMBERS = st.sampled_from([0.0, 0.5, 1.0, float("nan")])


@given(st.lists(st.tuples(TEXTS, WHOLE, NUMBERS, st.booleans()), max_size=12))
def test_rows_said_to_be_different_are(rows: list[tuple[str, int, float, bool]]) -> None:
    frame = pd.DataFrame(rows, columns=["text", "whole", "number", "flag"]).astype(
        {"text": "str", "whole": "int64", "number": "float64", "flag": "bool"}
    )
    for names in (["text"], ["whole"], ["text", "number"], ["flag", "text", "whole", "number"]):
        said = table_check.all_different([table_check.Seen.of(frame[name]) for name in names])
        spread = int(frame["whole"].max()) - int(frame["whole"].min()) if len(frame) else 0
        if "whole" in names and spread > 2**50:  # too many to number: then it is not said
            assert not (said and frame.duplicated(names).any())
        else:
            assert said == (not frame.duplicated(names).any())


ODD = st.sampled_from(["A1", "", "x", "w"])


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.tuples(ODD, ODD, st.integers(-1, 3), st.sampled_from([0.0, 1.5, float("nan")])), min_size=1, max_size=6)
)
def test_what_the_look_accepts_the_schema_accepts(rows: list[tuple[str, str, int, float]]) -> None:
    frame = pd.DataFrame(rows, columns=["unit", "axis", "row", "value"]).assign(column=np.arange(len(rows)))
    frame = frame.astype({"unit": "str", "axis": "str", "row": "int64", "column": "int64"})
    accepted = bool(np.isfinite(frame["value"]).all())
    try:
        tables.TABLES["covariance"].schema.validate(frame)
    except SchemaError:
        accepted = False
    assert right(frame) == accepted
