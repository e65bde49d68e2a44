"""How commands print: results, remarks, JSON documents, tables and files."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from inertial.uncertainty import rounding
from pipelines.cli.options import STANDARD_OUTPUT
from pipelines.tables.json_values import json_value
from schemas.errors import DONE, PART_FAILED, WrongUse
from schemas.log_lines import wants_json

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text


short, short_values = rounding.short, rounding.short_values  # numbers as commands print them
NARROW = 28  # characters of a word that a narrow terminal shows unbroken: the longest name of an effect has 27
STYLES = {"pass": "bold green", "fail": "bold red", "refused": "bold magenta"}


def console(*, stderr: bool = False) -> Console:
    """The console for results; brackets and colons in it are text, never markup."""
    from pipelines.cli.console import WordConsole

    plain = False if stderr and wants_json() else None  # no colours and no moving bar among objects of JSON
    return WordConsole(stderr=stderr, highlight=False, markup=False, emoji=False, force_terminal=plain)


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
    """One JSON document on standard output; numbers that JSON does not know become null.

    Where the output is not UTF-8, as a pipe on Windows, characters beyond ASCII are written as JSON's escapes.
    """
    escaped = not (sys.stdout.encoding or "utf-8").lower().startswith("utf")  # a text in memory has none
    sys.stdout.write(json.dumps(json_value(document), ensure_ascii=escaped, indent=1, allow_nan=False) + "\n")
    sys.stdout.flush()  # the readers of a running server wait for the document


def print_table(
    columns: Sequence[str],
    lines: Sequence[Sequence[str | Text]],
    title: str = "",
    *,
    fixed: int = 1,
    out: Console | None = None,
) -> None:
    """A table for people; numbers stand to the right.

    Neither they nor the first ``fixed`` columns are ever broken or cut. A column without any entry is left out. A table that
    needs more than the terminal has narrower gaps, or continues below with its other columns, the first ``fixed`` repeated;
    in a pipe it is as wide as it needs to be.
    """
    from pipelines.cli.console import limited

    shown = out or console()
    width = shown.width if limited(shown) else None
    cells = ([line[k] for line in lines] for k in range(len(columns)))
    made = [
        _Column(head, texts, fixed=k < fixed, in_pipe=width is None)
        for k, (head, texts) in enumerate(zip(columns, cells, strict=True))
    ]
    used = [column for k, column in enumerate(made) if k < fixed or not lines or column.filled]
    gap = min(GAPS, key=lambda gap: (len(_parts(used, fixed, width, gap)), -gap))
    for part in _parts(used, fixed, width, gap):
        _print_part(shown, part, title, gap)
        title = ""


GAPS = (3, 2)  # characters between two columns; the second where it saves a continuation of the table


class _Column:
    """A column of a table, with the characters that it needs at least and at most.

    Numbers, and a column that is ``fixed``, need their longest line, others their longest word. Words longer than any name are
    broken, but not in a pipe, which has no width.
    """

    def __init__(self, head: str, cells: Sequence[str | Text], *, fixed: bool, in_pipe: bool) -> None:
        texts = [str(cell) for cell in cells]
        lines = [line for text in (head, *texts) for line in text.splitlines()]
        longest_word = max((len(word) for line in lines for word in line.split(" ")), default=0)
        self.head, self.cells, self.filled = head, cells, any(text.strip() for text in texts)
        self.numeric = bool(texts) and all(map(_is_number, texts))
        self.fixed = fixed or self.numeric
        self.most = max(map(len, lines), default=0)
        self.least = self.most if self.fixed else longest_word if in_pipe else min(longest_word, NARROW)


def _parts(columns: Sequence[_Column], fixed: int, width: int | None, gap: int) -> list[list[_Column]]:
    """The columns in portions that fit a width, each with the first ``fixed`` ones."""
    if width is None:
        return [list(columns)]
    head = list(columns[:fixed])
    parts, portion = list[list[_Column]](), list(head)
    for column in columns[fixed:]:
        if len(portion) > len(head) and sum(member.least + gap for member in [*portion, column]) + 1 > width:
            parts.append(portion)
            portion = list(head)
        portion.append(column)
    return [*parts, portion]


def _print_part(shown: Console, columns: Sequence[_Column], title: str, gap: int) -> None:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, gap - 2))
    widths = _widths(columns, shown.width - 1 - gap * len(columns))
    for column, width in zip(columns, widths, strict=True):
        justify = "right" if column.numeric else "left"
        table.add_column(column.head, justify=justify, overflow="fold", no_wrap=column.fixed, width=width)
    for line in zip(*(column.cells for column in columns), strict=True):
        table.add_row(*line)
    table.width = sum(widths) + gap * len(widths) + 1
    if title:
        shown.print(title, style="italic", markup=False)  # the table's own title would wrap to the width of the table
    shown.print(table, crop=False)


def _widths(columns: Sequence[_Column], room: int) -> list[int]:
    """Widths between what columns need at least and at most; room is given to the narrowest of those that want more."""
    widths = [column.least for column in columns]
    while sum(widths) < room and (wanting := [k for k, column in enumerate(columns) if widths[k] < column.most]):
        widths[min(wanting, key=lambda k: widths[k])] += 1
    return widths


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
