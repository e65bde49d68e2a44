"""Every command that is found: it is in the help, explains itself and its options, and is named in the documents."""

import re
import shlex
from collections import Counter
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path

from each import each
from typer.core import TyperCommand
from typer.main import get_command
from typer.testing import CliRunner

from pipelines.cli import COMMANDS, app

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMED = set(re.findall(r"tumbleline +([a-z]+)", "\n".join(page.read_text(encoding="utf-8") for page in PAGES)))


def leaves(command: object) -> Iterator[TyperCommand]:
    """A command, or its subcommands at any depth."""
    below = getattr(command, "commands", {})
    if not below:
        yield command
    for one in below.values():
        yield from leaves(one)


@cache
def help_of(columns: int, *words: str) -> str:
    """The help of the program or of a command, so wide."""
    return CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": str(columns), "NO_COLOR": "1"}).stdout


@each(COMMANDS)
def test_a_command_is_in_the_help_and_the_documents_and_explains_itself_and_every_option(name: str) -> None:
    text = help_of(200)
    summary = COMMANDS[name].summary
    assert re.search(rf"│ {name} +{re.escape(summary)} +│", text)
    assert summary.endswith(".")
    assert len(summary) <= 90
    assert name in NAMED
    module = import_module(f"pipelines.cli.{COMMANDS[name].module}")
    assert (module.__doc__ or "").startswith(f"``tumbleline {name}``: ")
    for leaf in leaves(get_command(app).get_command(None, name)._load()):
        assert leaf.help, leaf.name
        texts = {p.name: getattr(p, "help", None) for p in leaf.params}
        assert [name for name, text in texts.items() if not text] == [], leaf.name
        assert [
            text for text in (leaf.help, *texts.values()) if re.search(r"\[[a-z/]+\]", text)
        ] == []  # it is lost as markup


@each(COMMANDS)
def test_the_help_of_a_command_and_of_a_subcommand_shows_two_examples_with_options_that_exist(name: str) -> None:
    group = get_command(app).get_command(None, name)._load()
    below = getattr(group, "commands", {})
    for words in [(name,), *((name, own) for own in below)]:
        text = help_of(160, *words).split("Examples:")[1]
        examples = re.findall(rf"^ *(tumbleline {name}\b.*?) *$", text, re.MULTILINE)
        assert len(set(examples)) == 2, words
        for example in examples:
            command, rest = meant(group, shlex.split(example)[2:])
            assert len(words) == 1 or command is below[words[1]], example
            command.make_context(name, rest)  # parses: every option, argument and value is of its kind


def test_help_needs_eighty_columns_breaks_no_option_and_its_parts_stand_together() -> None:
    parts = [command.part for command in COMMANDS.values()]
    assert min(Counter(parts).values()) > 1  # a part of one command is a heading mistyped
    assert sum(one != other for one, other in pairwise(parts)) == len(set(parts)) - 1
    for name in COMMANDS:
        group = get_command(app).get_command(None, name)._load()
        subcommands = [[name, own] for own in getattr(group, "commands", {})]
        for words in [[name], *subcommands]:
            text = help_of(80, *words)
            lines = text.splitlines()
            assert [line for line in lines if len(line) > 80 and not line.lstrip().startswith("tumbleline ")] == []
            if len(words) == 1 and subcommands:
                continue  # the options are those of the subcommands
            leaf = getattr(group, "commands", {}).get(words[-1], group)
            options = {option for p in leaf.params for option in p.opts if option.startswith("--")}
            assert {option for option in options if not re.search(rf"{option}\b", text)} == set(), words


def meant(command: object, rest: list[str]) -> tuple[TyperCommand, list[str]]:
    """The subcommand that words begin with, or the usual one of the group, and the words after it."""
    below = getattr(command, "commands", {})
    if not below:
        return command, rest
    if rest and rest[0] in below:
        return below[rest[0]], rest[1:]
    return below[command.usual], rest
