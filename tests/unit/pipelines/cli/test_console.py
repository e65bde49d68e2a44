"""Eighty columns: no word is broken, nothing is cut, and what is copied stays on one line."""

import io

import pytest
from rich.console import Console

from pipelines.cli.console import WordConsole
from pipelines.cli.printing import console, print_table

HEADS = ["run", "started (UTC)", "station", "passed", "largest deviation, µg", "meaning of the number", "unit"]
LINE = ["production-30db20d7e5", "2026-11-22 09:24", "simulated", "8 of 8", "472.25", "deviation of the norm", "µg"]


def printed(width: int, *, terminal: bool = True) -> list[str]:
    sink = io.StringIO()
    out = WordConsole(file=sink, width=width, force_terminal=terminal, color_system=None, legacy_windows=False)
    print_table(HEADS, [LINE, LINE], out=out)
    return sink.getvalue().splitlines()


@pytest.mark.parametrize("width", [60, 80, 100, 200])
def test_a_table_fits_the_terminal_and_keeps_every_word(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    lines = printed(width)
    assert max(map(len, lines)) <= width
    words = " ".join(lines).split()
    for text in (*HEADS, *LINE):
        assert set(text.split()) <= set(words), text
    assert sum("production-30db20d7e5" in line for line in lines) % 2 == 0
    assert (
        sum("production-30db20d7e5" in line for line in printed(80, terminal=False)) == 2
    )  # in a pipe it is one table


def test_a_sentence_is_wrapped_between_words_and_a_command_stays_whole() -> None:
    sink = io.StringIO()
    out = WordConsole(file=sink, width=40, force_terminal=True, color_system=None)
    out.print("the largest deviation of the norm from local gravity over all poses", soft_wrap=True)
    out.print(
        "  tumbleline diagnose a/long/path/of/dwells.parquet --temperatures a/long/path/of/history.parquet",
        soft_wrap=True,
    )
    out.print(f"report  /{'folder/' * 12}report.html", soft_wrap=True)
    first, second, command, report = sink.getvalue().splitlines()
    assert f"{first.strip()} {second}" == "the largest deviation of the norm from local gravity over all poses"
    assert command.endswith("history.parquet")
    assert report.endswith("report.html")


COLUMNS = ["effect", "of the", "size\nµg", "p", "left\nµg", "left out\nµg", "with"]
LINES = [["scale_temperature_quadratic (αT2)", "sensor", "181", "1e-212", "392", "425", ""]]


def table_text(width: int, *args: object, **kwargs: object) -> str:
    out = Console(file=io.StringIO(), width=width, markup=False, emoji=False)
    print_table(*args, out=out, **kwargs)  # pyright: ignore[reportArgumentType]
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


@pytest.mark.parametrize("width", [20, 40, 60, 80, 200])
def test_no_number_and_no_heading_is_ever_cut_and_words_are_broken_before_the_table_grows(width: int) -> None:
    text = table_text(width, COLUMNS, LINES, fixed=6)
    for word in ("scale_temperature_quadratic (αT2)", "sensor", "181", "1e-212", "392", "425", "size", "left out"):
        assert word in text
    text = table_text(width, ["unit", "why"], [["U1", "the proof mass hangs on an arm that load turns " * 5]])
    assert max(map(len, text.splitlines())) <= max(width, len("  U1     ") + 24)
    assert " ".join(text.split()).endswith("load turns")


def test_brackets_and_colons_of_a_reason_are_printed_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(["unit", "why"], [["U1", "dropped [red] [/x] :warning:"], ["[2]", "x"]], title="archive [a]")
    console().print("run [/b] :bug:")
    out = capsys.readouterr().out
    assert all(words in out for words in ("dropped [red] [/x] :warning:", "[2]", "archive [a]", "run [/b] :bug:"))
