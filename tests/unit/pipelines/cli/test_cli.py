"""What commands load, take from their words, ask at the terminal, and say at the end of a demonstration."""

import errno
import io
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from typer.core import TyperCommand
from typer.testing import CliRunner

from pipelines import cli
from pipelines.cli import demo, take_texts_as_given
from pipelines.cli.terminal import agreed
from schemas.errors import UNUSABLE, WrongUse


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


@pytest.fixture
def entered(monkeypatch):
    def type_(text):
        monkeypatch.setattr("sys.stdin", io.StringIO(text))

    return type_


def test_enter_is_yes_no_is_no_and_what_is_neither_is_asked_again(entered, capsys):
    for text, yes in (("\n", True), ("y\n", True), ("Yes \n", True), ("n\n", False), ("stop\n", False)):
        entered(text)
        assert agreed("Measure?") is yes
    capsys.readouterr()
    entered("maybe\nn\n")
    assert not agreed("Measure?")
    told = capsys.readouterr().err
    assert "'maybe' is neither yes nor no: y or Enter measures it, n leaves it" in " ".join(told.split())
    assert told.count("Measure? [Y/n]") == 2
    entered("")  # the terminal closed
    with pytest.raises(WrongUse, match="ended before an answer"):
        agreed("Measure?")


def test_a_full_disk_is_no_defect_of_the_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(cli, "app", full)
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == UNUSABLE
    assert "make room" in capsys.readouterr().err


def test_a_demonstration_keeps_the_model_of_the_one_before(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text("mine", "utf-8")
    aside = demo._put_aside(tmp_path / "model.toml")
    assert aside == tmp_path / "model-1.toml"
    assert aside.read_text("utf-8") == "mine"
    assert demo._put_aside(tmp_path / "model.toml") is None
