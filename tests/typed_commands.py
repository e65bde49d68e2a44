"""Commands as people type them: which command a line means, and whether its options exist."""

import re
import shlex
import sys
from functools import cache
from itertools import pairwise
from typing import Any

from typer.main import get_command

from pipelines.cli import COMMANDS, app


@cache
def loaded(name: str) -> Any:
    """A command with its options, made once: a page names it many times."""
    group: Any = get_command(app)
    return group.get_command(None, name)._load()


def command_of(words: list[str]) -> tuple[Any, list[str]]:
    """The command that the words name, and what is left of them."""
    assert words[0] in COMMANDS, f"no command is called {words[0]}"
    command = loaded(words[0])
    rest = words[1:]
    while getattr(command, "commands", None) and rest and rest[0] in command.commands:
        command, rest = command.commands[rest[0]], rest[1:]
    usual = getattr(command, "usual", "")  # the subcommand that is meant where none is named
    return (command.commands[usual] if usual else command), rest


def known_options(command: Any) -> set[str]:
    """Options of a command as they are typed."""
    return {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)} | {"--help"}


def options_below(name: str) -> set[str]:
    """Options of a command and of its subcommands."""
    command = loaded(name)
    below = getattr(command, "commands", {}).values()
    return known_options(command).union(*(known_options(one) for one in below))


def unknown_options(line: str) -> set[str]:
    """The options of a line ``tumbleline …`` that its command does not have."""
    command, rest = command_of(shlex.split(line.replace("…", "X"))[1:])
    options = {
        word.partition("=")[0] for word in rest if word.startswith("-") and len(word) > 1 and not word[1].isdigit()
    }
    return options - known_options(command)


def unknown_settings(line: str) -> set[str]:
    """The keys of ``--set KEY=VALUE`` in a line that its command does not have."""
    command, rest = command_of(shlex.split(line.replace("…", "X"))[1:])
    keys = {words[1].partition("=")[0] for words in pairwise(rest) if words[0] == "--set"}
    if not keys:
        return set()
    listed = " ".join(parameter.help or "" for parameter in command.params if "--set" in parameter.opts)
    module = sys.modules[command.callback.__module__]
    own = set().union(*(getattr(module, name, {}) for name in ("SETTINGS", "KEYS")))
    return {key for key in keys - own if not key.isupper() and "." not in key and not re.search(rf"\b{key}\b", listed)}


def code_spans(page: str) -> list[str]:
    """The code of a page in Markdown: spans, in tables too, and the lines of blocks that begin with the program's name."""
    blocks = re.findall(r"^```.*?\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    prose = re.sub(r"^```.*?^```$", "", page, flags=re.MULTILINE | re.DOTALL)
    typed = re.findall(r"^ *\$? ?(tumbleline .*)$", re.sub(r"\\\n *", " ", "\n".join(blocks)), re.MULTILINE)
    return [*re.findall(r"`([^`\n]+)`", prose), *re.findall(r"^    (tumbleline .*)$", prose, re.MULTILINE), *typed]


def printed_commands(text: str) -> list[list[str]]:
    """The commands that stand on lines of their own in an output, as words."""
    return [shlex.split(line) for line in re.findall(r"^ *tumbleline (.*)$", text, flags=re.MULTILINE)]
