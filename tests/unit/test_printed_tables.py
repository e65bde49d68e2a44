"""Tables for people: a number that is cut off is another number, and brackets are somebody's words."""

import io

import pytest
from rich.console import Console
from rich.text import Text

from pipelines.cli.console import WordConsole
from pipelines.cli.options import console, print_table

COLUMNS = ["effect", "of the", "size\nµg", "p", "left\nµg", "left out\nµg", "with"]
LINES = [["scale_temperature_quadratic (αT2)", "sensor", "181", "1e-212", "392", "425", ""]]


def printed(width: int, *args: object, **kwargs: object) -> str:
    out = Console(file=io.StringIO(), width=width, markup=False, emoji=False)
    print_table(*args, out=out, **kwargs)  # pyright: ignore[reportArgumentType]
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


@pytest.mark.parametrize("width", [20, 40, 60, 80, 200])
def test_no_number_and_no_heading_is_ever_cut(width: int) -> None:
    text = printed(width, COLUMNS, LINES, whole=6)
    for word in ("scale_temperature_quadratic (αT2)", "sensor", "181", "1e-212", "392", "425", "size", "left out"):
        assert word in text


@pytest.mark.parametrize("width", [20, 60])
def test_words_are_broken_between_words_before_the_table_grows(width: int) -> None:
    text = printed(width, ["unit", "why"], [["U1", "the proof mass hangs on an arm that load turns"]])
    assert max(map(len, text.splitlines())) <= max(width, len("  U1     ") + 24)
    assert " ".join(text.split()).endswith("load turns")


def test_a_table_that_fits_is_no_wider_than_the_terminal() -> None:
    text = printed(100, ["unit", "why"], [["U1", "because " * 30]])
    assert max(map(len, text.splitlines())) <= 100


def test_brackets_and_colons_of_a_reason_are_printed_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(["unit", "why"], [["U1", "dropped [red] [/x] :warning:"], ["[2]", "x"]], title="archive [a]")
    console().print("run [/b] :bug:")
    out = capsys.readouterr().out
    assert all(words in out for words in ("dropped [red] [/x] :warning:", "[2]", "archive [a]", "run [/b] :bug:"))


def test_a_cell_may_have_a_style() -> None:
    assert "pass" in printed(40, ["result"], [[Text("pass", style="bold green")]])


def test_a_column_without_an_entry_is_left_out_and_an_empty_table_keeps_its_heads() -> None:
    text = printed(80, COLUMNS, LINES)
    assert "with" not in text.split()
    assert "scale_temperature_quadratic" in text
    assert printed(80, ["serial", "reason"], [["", ""]]).split()[0] == "serial"  # the first column says what a row is
    assert {"unit", "why"} <= set(printed(80, ["unit", "why"], []).split())


def test_narrower_gaps_save_a_continuation_of_one_column() -> None:
    heads = [
        "slot",
        "unit",
        "result",
        "grade",
        "fit\nµg",
        "verify\nµg",
        "error\nµg",
        "period\nµg",
        "N\nµg/√Hz",
        "B\nµg",
    ]
    line = ["0", "TL0001", "pass", "consumer", "352", "474", "595", "731", "10.3", "299"]
    out = WordConsole(file=io.StringIO(), width=80, force_terminal=True, color_system=None)
    print_table(heads, [line], out=out)
    text = out.file.getvalue()  # pyright: ignore[reportAttributeAccessIssue]
    assert text.count("slot") == 1
    assert max(map(len, text.splitlines())) <= 80
    wide = printed(200, heads, [line])
    assert "  slot   unit     result" in wide
