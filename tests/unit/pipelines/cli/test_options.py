"""Values of the command line that need no conversion are those that typer would give; the others are converted by typer."""

from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from typer.core import TyperCommand
from typer.testing import CliRunner

from pipelines.cli import take_texts_as_given


class _Direct(TyperCommand):
    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        take_texts_as_given(self)


def _called(words: list[str], *, direct: bool) -> tuple[dict[str, Any], int, str]:
    """What a command receives, its exit status and what it prints."""
    app, received = typer.Typer(pretty_exceptions_enable=False), dict[str, Any]()

    @app.command(cls=_Direct if direct else TyperCommand)
    def command(
        names: Annotated[list[str] | None, typer.Argument()] = None,
        text: Annotated[str, typer.Option("--text")] = "usual",
        short: Annotated[str, typer.Option("--short", parser=lambda given: given[:2])] = "",
        number: Annotated[int, typer.Option("--number", min=1)] = 3,
        file: Annotated[Path | None, typer.Option("--file")] = None,
        every: Annotated[list[str] | None, typer.Option("--every")] = None,
        *,
        flag: Annotated[bool, typer.Option("--flag")] = False,
    ) -> None:
        received.update(locals())

    result = CliRunner().invoke(app, words)
    received.pop("received", None)
    return received, result.exit_code, result.output


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["one", "two"],
        ["--text", "", "--short", "letters"],
        ["--text", "naïve µg", "--every", "a", "--every", "b"],
        ["--number", "7", "--file", "there.toml", "--flag"],
        ["--number", "0"],
        ["--number", "many"],
        ["--text", "\udcff"],
        ["--nothing"],
        ["--help"],
    ],
    ids=" ".join,
)
def test_a_command_receives_what_typer_would_give(words: list[str]) -> None:
    given = _called(words, direct=True)
    assert given == _called(words, direct=False)
    assert given[0] or given[1] or "--help" in words
