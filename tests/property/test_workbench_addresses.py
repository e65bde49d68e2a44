"""An address says the whole state of a page: what it is parsed to is what it was made from."""

import shlex
from urllib.parse import parse_qsl, urlsplit

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from pipelines.workbench.state import MissingPage, PageState, UnitsPage

PAGES = sorted(PageState.__subclasses__(), key=lambda kind: kind.__name__)

# the first texts load a table
CALM = settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
TEXTS, DATE = st.lists(TEXT.filter(bool), max_size=4, unique=True).map(tuple), st.sampled_from(["", "2026-11-22"])


def states(kind: type[PageState]) -> st.SearchStrategy[PageState]:
    made = {}
    for name, field in kind.model_fields.items():
        said = str(field.annotation)
        if "tuple" in said:
            made[name] = TEXTS
        elif "Literal" in said:
            made[name] = st.sampled_from(list(TypeAdapter(field.annotation).json_schema()["enum"]))
        elif field.annotation is int:
            made[name] = st.integers(1, 60)
        elif field.annotation is float:
            made[name] = st.floats(0.0, 20.0)
        else:
            made[name] = DATE if name in {"since", "until"} else TEXT
    return st.fixed_dictionaries(made).map(lambda values: kind(**values))


@pytest.mark.parametrize("kind", PAGES, ids=lambda kind: kind.__name__)
@CALM
@given(data=st.data())
def test_parse_after_address_is_the_identity(kind: type[PageState], data: st.DataObject) -> None:
    state = data.draw(states(kind))
    parts = urlsplit("http://x" + state.address())
    assert parts.path == kind.PATH
    again, problems = kind.parse(parse_qsl(parts.query, keep_blank_values=True))
    assert not problems
    assert again == state


@pytest.mark.parametrize("kind", PAGES, ids=lambda kind: kind.__name__)
@CALM
@given(data=st.data())
def test_every_state_has_a_command_line_that_a_shell_reads_back(kind: type[PageState], data: st.DataObject) -> None:
    state = data.draw(states(kind))
    if state.arguments():
        assert shlex.split(state.command("an archive"))[1:-2] == state.arguments()


@CALM
@given(st.lists(st.tuples(TEXT, TEXT), max_size=12))
def test_no_address_breaks_a_page(pairs: list[tuple[str, str]]) -> None:
    for kind in PAGES:
        state, _ = kind.parse([*pairs, ("page", "x"), ("against", "y"), ("rate", "nan"), ("since", "1")])
        assert kind.parse(parse_qsl(urlsplit(state.address()).query, keep_blank_values=True))[0] == state


def test_a_broken_value_is_left_out_and_said() -> None:
    state, problems = UnitsPage.parse([("search", "a"), ("page", "-3"), ("outcome", "perhaps"), ("strange", "1")])
    assert state == UnitsPage(search="a")
    assert len(problems) == 2
    assert MissingPage.parse([("added", "third_order")] * 2) == (MissingPage(added=("third_order",)), [])
