"""Eighty columns: no word is broken, nothing is cut, and what is copied stays on one line."""

import io

import pytest
from each import each

from pipelines.cli.console import WordConsole
from pipelines.cli.printing import console, print_table

HEADS = ["run", "started (UTC)", "station", "passed", "largest deviation, µg", "meaning of the number", "unit"]
LINE = ["production-30db20d7e5", "2026-11-22 09:24", "simulated", "8 of 8", "472.25", "deviation of the norm", "µg"]


def printed(width: int, *table: object, terminal: bool = True, **how: object) -> list[str]:
    sink = io.StringIO()
    out = WordConsole(file=sink, width=width, force_terminal=terminal, color_system=None, legacy_windows=False)
    print_table(*table, out=out, **how)  # pyright: ignore[reportArgumentType]
    return sink.getvalue().splitlines()


@each([60, 80, 100, 200])
def test_a_table_fits_the_terminal_and_keeps_every_word(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    lines = printed(width, HEADS, [LINE, LINE])
    assert max(map(len, lines)) <= width
    assert set(" ".join((*HEADS, *LINE)).split()) <= set(" ".join(lines).split())
    assert sum(LINE[0] in line for line in lines) % 2 == 0
    piped = printed(80, HEADS, [LINE, LINE], terminal=False)
    assert sum(LINE[0] in line for line in piped) == 2  # it is one table


def test_a_sentence_is_wrapped_between_words_and_a_command_stays_whole() -> None:
    sink = io.StringIO()
    out = WordConsole(file=sink, width=40, force_terminal=True, color_system=None)
    text = "the largest deviation of the norm from local gravity over all poses"
    words = f"  tumbleline diagnose {'a/long/path/' * 4}dwells.parquet --temperatures {'of/' * 9}history.parquet"
    for one in (text, words, f"report  /{'folder/' * 12}report.html"):
        out.print(one, soft_wrap=True)
    first, second, command, report = sink.getvalue().splitlines()
    assert f"{first.strip()} {second}" == text
    assert command.endswith("history.parquet")
    assert report.endswith("report.html")


COLUMNS = ["effect", "of the", "size\nµg", "p", "left\nµg", "left out\nµg", "with"]
CELLS = ["scale_temperature_quadratic (αT2)", "sensor", "181", "1e-212", "392", "425"]


@each([20, 40, 60, 80, 200])
def test_no_number_and_no_heading_is_ever_cut_and_words_are_broken_before_the_table_grows(width: int) -> None:
    text = "\n".join(printed(width, COLUMNS, [[*CELLS, ""]], terminal=False, fixed=6))
    assert [word for word in (*CELLS, "size", "left out") if word not in text] == []
    why = "the proof mass hangs on an arm that load turns " * 5
    lines = printed(width, ["unit", "why"], [["U1", why]], terminal=False)
    assert max(map(len, lines)) <= max(width, len("  U1     ") + 24)
    assert " ".join(" ".join(lines).split()).endswith("load turns")


def test_brackets_and_colons_of_a_reason_are_printed_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(["unit", "why"], [["U1", "dropped [red] [/x] :warning:"], ["[2]", "x"]], title="archive [a]")
    console().print("run [/b] :bug:")
    out = capsys.readouterr().out
    assert all(words in out for words in ("dropped [red] [/x] :warning:", "[2]", "archive [a]", "run [/b] :bug:"))
