"""Generated tables, texts and documents, and how many of them a property is tried with."""

from collections.abc import Callable

import pandas as pd
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from schemas.tables import TABLES, Column, Table

FEW = settings(
    max_examples=5,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture],
)
"""The same examples every time; a folder may be shared by the examples of a test."""

SOME = settings(FEW, max_examples=25)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
NAMES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,10}", fullmatch=True)
DOCUMENTS = st.dictionaries(
    TEXTS,
    st.recursive(
        st.none()
        | st.booleans()
        | st.integers(-(2**53), 2**53)
        | st.floats(allow_nan=False, allow_infinity=False)
        | TEXTS,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
        max_leaves=8,
    ),
    max_size=5,
)
"""Contents of manifests: whatever JSON can say."""


def cells(column: Column, *, finite: bool) -> st.SearchStrategy[object]:
    """Every value that a column of a table allows."""
    of_kind: dict[str, Callable[[], st.SearchStrategy[object]]] = {
        "bool": st.booleans,
        "int64": lambda: st.integers(int(column.low if column.low is not None else -(2**63)), 2**63 - 1),
        "float64": lambda: st.floats(
            min_value=column.low, allow_nan=column.missing and not finite, allow_infinity=not finite
        ),
        "str": lambda: (
            st.sampled_from(column.allowed) if column.allowed else TEXTS.filter(bool) if column.filled else TEXTS
        ),
    }
    return of_kind[column.kind]()


@st.composite
def frames(draw: st.DrawFn, name: str) -> pd.DataFrame:
    """A table of the archive with up to five rows of all that its contract allows, and a column that it does not know."""
    table: Table = TABLES[name]
    rows = draw(st.integers(0, 5))
    columns = {
        key: draw(st.lists(cells(column, finite=key in table.finite), min_size=rows, max_size=rows))
        for key, column in table.columns.items()
    } | {"humidity_pct": draw(st.lists(st.floats(0.0, 100.0), min_size=rows, max_size=rows))}
    kinds = {key: column.kind for key, column in table.columns.items()} | {"humidity_pct": "float64"}
    frame = pd.DataFrame(columns).astype(kinds)
    return frame.drop_duplicates(list(table.key), ignore_index=True) if table.key else frame
