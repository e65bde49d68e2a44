"""How commands print: results, remarks, JSON documents, tables and files."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from inertial.uncertainty import rounding
from pipelines.tables.json_values import json_value
from schemas.errors import DONE, PART_FAILED, WrongUse

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

STANDARD_OUTPUT = Path("-")  # the name of standard output in place of a file, as the programs of a system understand it

short, short_values = rounding.short, rounding.short_values  # numbers as commands print them
NARROW = 28  # characters of a word that a narrow terminal shows unbroken: the longest name of an effect has 27
STYLES = {"pass": "bold green", "fail": "bold red", "refused": "bold magenta"}


def console(*, stderr: bool = False) -> Console:
    """The console for results; brackets and colons in it are text, never markup."""
    from pipelines.cli.console import WordConsole

    return WordConsole(stderr=stderr, highlight=False, markup=False, emoji=False)


def error_console() -> Console:
    """The console for progress and remarks: standard output has results only."""
    return console(stderr=True)


def say(what: object = "", style: str = "") -> None:
    """Print a text, or another thing that rich shows, on standard output."""
    console().print(what, style=style)


def publish(path: Path, content: str | bytes, what: str) -> None:
    """Write a file, complete or not at all, and name it on standard error."""
    from pipelines.archive import files

    files.publish(path, content.encode() if isinstance(content, str) else content, what, files.ELSEWHERE)
    remark(f"{what}: {path}")


def remark(text: str, style: str = "", end: str = "\n") -> None:
    """Print a text on standard error."""
    error_console().print(text, style=style, end=end)


def give(document: Any, show: Callable[[Any], object] | Iterable[str], *, as_json: bool) -> None:
    """The result of a command: its document as JSON, or for people lines, or what ``show`` prints of the document."""
    if as_json:
        print_json(document)
    elif callable(show):
        show(document)
    else:
        for line in show:
            say(line)


def conclude(document: Any, show: Callable[[Any], object] | Iterable[str], *, as_json: bool, passed: bool) -> NoReturn:
    """The end of a command: its result as :func:`give` shows it, and the exit status, which says whether all passed."""
    give(document, show, as_json=as_json)
    raise typer.Exit(DONE if passed else PART_FAILED)


def warn(texts: Iterable[str]) -> None:
    """Print warnings that a document has."""
    for text in texts:
        say(f"warning: {text}", style="yellow")


def print_json(document: Any) -> None:
    """One JSON document on standard output; numbers that JSON does not know become null."""
    sys.stdout.write(json.dumps(json_value(document), ensure_ascii=False, indent=1, allow_nan=False) + "\n")
    sys.stdout.flush()  # the readers of a running server wait for the document


def print_table(
    columns: Sequence[str],
    lines: Sequence[Sequence[str | Text]],
    title: str = "",
    *,
    whole: int = 1,
    out: Console | None = None,
) -> None:
    """A table for people; numbers stand to the right.

    Neither they nor the first ``whole`` columns are ever broken or cut. A column without any entry is left out. A table that
    needs more than the terminal has narrower gaps, or continues below with its other columns, the first ``whole`` repeated;
    in a pipe it is as wide as it needs to be.
    """
    from pipelines.cli.console import limited

    shown = out or console()
    used = [k for k in range(len(columns)) if k < whole or not lines or any(str(line[k]).strip() for line in lines)]
    columns, lines = [columns[k] for k in used], [[line[k] for k in used] for line in lines]
    width = shown.width if limited(shown) else None
    least = [_least(k < whole, column, [line[k] for line in lines], width) for k, column in enumerate(columns)]
    gap = min(GAPS, key=lambda one: (len(_parts(least, whole, width, one)), -one))
    for part in _parts(least, whole, width, gap):
        kept = [[line[k] for k in part] for line in lines]
        _print_part(shown, [columns[k] for k in part], kept, title, [least[k] for k in part], whole, gap)
        title = ""


GAPS = (3, 2)  # characters between two columns; the second where it saves a continuation of the table


def _least(kept: bool, column: str, cells: Sequence[str | Text], width: int | None) -> int:
    """Characters that a column needs at least: its longest line where it is kept whole, else its longest word.

    Words longer than any name are broken, but not in a pipe, which has no ``width``.
    """
    texts = [str(cell) for cell in cells]
    if kept or _numeric(texts):
        return _longest([column, *texts], None)
    longest = _longest([column, *texts], " ")
    return longest if width is None else min(longest, NARROW)


def _parts(least: Sequence[int], whole: int, width: int | None, gap: int) -> list[list[int]]:
    """The columns in portions that fit a width, each with the first ``whole`` ones."""
    if width is None:
        return [list(range(len(least)))]
    head = list(range(min(whole, len(least))))
    parts, own = list[list[int]](), list(head)
    for k in range(len(head), len(least)):
        if len(own) > len(head) and sum(least[m] + gap for m in [*own, k]) + 1 > width:
            parts.append(own)
            own = list(head)
        own.append(k)
    return [*parts, own]


def _print_part(
    shown: Console,
    columns: Sequence[str],
    lines: Sequence[Sequence[str | Text]],
    title: str,
    least: Sequence[int],
    whole: int,
    gap: int,
) -> None:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, gap - 2))
    texts = [[str(line[number]) for line in lines] for number in range(len(columns))]
    most = [_longest([column, *own], None) for column, own in zip(columns, texts, strict=True)]
    widths = _widths(least, most, shown.width - 1 - gap * len(columns))
    for number, column in enumerate(columns):
        numeric = _numeric(texts[number])
        justify = "right" if numeric else "left"
        kept = numeric or number < whole
        table.add_column(column, justify=justify, overflow="fold", no_wrap=kept, width=widths[number])
    for line in lines:
        table.add_row(*line)
    table.width = sum(widths) + gap * len(widths) + 1
    if title:
        shown.print(title, style="italic", markup=False)  # the table's own title would wrap to the width of the table
    shown.print(table, crop=False)


def _widths(least: Sequence[int], most: Sequence[int], room: int) -> list[int]:
    """Widths between what columns need at least and at most; room is given to the narrowest of those that want more."""
    widths = list(least)
    while sum(widths) < room and (wanting := [k for k in range(len(widths)) if widths[k] < most[k]]):
        widths[min(wanting, key=lambda k: widths[k])] += 1
    return widths


def _numeric(cells: Sequence[str]) -> bool:
    return bool(cells) and all(map(_is_number, cells))


def _longest(texts: Sequence[str], between: str | None) -> int:
    """The longest line of texts, or the longest word with line breaks ``between`` words."""
    pieces = (piece for text in texts for line in text.splitlines() for piece in line.split(between or "\n"))
    return max(map(len, pieces), default=0)


def _is_number(text: str) -> bool:
    return text.replace(".", "", 1).replace("-", "", 1).replace("−", "", 1).replace("e", "", 1).isdigit() or not text


def is_standard_output(path: Path | None, command: str, *, as_json: bool = False) -> bool:
    """Whether a file is to be printed; refused beside a JSON document, which has standard output for itself."""
    if path == STANDARD_OUTPUT and as_json:
        raise WrongUse(
            f"{command}: --json and the output '-' both print on standard output, one is possible; leave one out"
        )
    return path == STANDARD_OUTPUT


def refuse_standard_output(path: Path | None, command: str, why: str) -> None:
    """Refuse ``-`` where a file of the system is needed."""
    if path == STANDARD_OUTPUT:
        raise WrongUse(f"{command}: output '-' is standard output, a file is needed: {why}; name one")


def cell(value: object) -> str:
    """A value of a stored table as an entry of a printed one."""
    return short(value, 5) if isinstance(value, float) else str(value)


def print_text(text: str) -> None:
    """A file's text on standard output, byte for byte."""
    typer.echo(text, nl=False)
