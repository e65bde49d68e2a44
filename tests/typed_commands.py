"""Commands as people type them: which command a line means, and whether its options exist."""

import re
import shlex

from typer.main import get_command

from pipelines.cli import COMMANDS, app


def command_of(words: list[str]) -> tuple[object, list[str]]:
    """The command that the words name, and what is left of them."""
    assert words[0] in COMMANDS, f"no command is called {words[0]}"
    command = get_command(app).get_command(None, words[0])._load()
    rest = words[1:]
    while getattr(command, "commands", None) and rest and rest[0] in command.commands:
        command, rest = command.commands[rest[0]], rest[1:]
    usual = getattr(command, "usual", "")  # the subcommand that is meant where none is named
    return (command.commands[usual] if usual else command), rest


def known_options(command: object) -> set[str]:
    """Options of a command as they are typed."""
    return {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)} | {"--help"}


def options_below(name: str) -> set[str]:
    """Options of a command and of its subcommands."""
    command = get_command(app).get_command(None, name)._load()
    below = getattr(command, "commands", {}).values()
    return known_options(command).union(*(known_options(one) for one in below))


def unknown_options(line: str) -> set[str]:
    """The options of a line ``tumbleline …`` that its command does not have."""
    command, rest = command_of(shlex.split(line.replace("…", "X"))[1:])
    options = {
        word.partition("=")[0] for word in rest if word.startswith("-") and len(word) > 1 and not word[1].isdigit()
    }
    return options - known_options(command)


def printed_commands(text: str) -> list[list[str]]:
    """The commands that stand on lines of their own in an output, as words."""
    return [shlex.split(line) for line in re.findall(r"^ *tumbleline (.*)$", text, flags=re.MULTILINE)]
