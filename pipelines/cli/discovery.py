"""The commands: each is one module of this package with the constants PART, ORDER and SUMMARY.

The constants are read from the source, and no module is imported, so that help starts quickly.
"""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

CONSTANT = re.compile(r'^(PART|ORDER|SUMMARY) = (?:"(.+)"|(\d+))$', re.MULTILINE)
COMMAND = re.compile(r"^(?:def command\(|app = typer\.Typer\()", re.MULTILINE)


class IncompleteCommand(Exception):
    """A module with an incomplete command: a defect that its author must correct."""


class CommandModule(NamedTuple):
    """A command in the help.

    module : name inside this package · part : heading of the help · order : place in the help · summary : one sentence
    """

    module: str
    part: str
    order: int
    summary: str


def find_commands(folder: Path) -> dict[str, CommandModule]:
    """The commands of a folder by name, in the order of the help.

    The name is the name of the module; a module with a reserved name of Python ends in an underscore (``import_``).

    Raises
    ------
    IncompleteCommand
        A module has the function or application of a command without its constants, or the reverse, or an ORDER twice.
    """
    commands: dict[str, CommandModule] = {}
    for path in sorted(folder.glob("*.py")):
        if path.stem.startswith("__"):
            continue
        command = _read(path)
        if command is not None:
            commands[path.stem.removesuffix("_")] = command
    ordered = sorted(commands.items(), key=lambda item: item[1].order)
    for (first, one), (second, other) in pairwise(ordered):
        if one.order == other.order:
            raise IncompleteCommand(f"{second}.py: ORDER is {one.order}, as in {first}.py; choose another number")
    return dict(ordered)


def _read(path: Path) -> CommandModule | None:
    """The command of a module; None for a module without a command."""
    text = path.read_text(encoding="utf-8")
    values = {name: string or number for name, string, number in CONSTANT.findall(text)}
    callable_ = COMMAND.search(text) is not None
    if not values and not callable_:
        return None
    missing = [name for name in ("PART", "ORDER", "SUMMARY") if name not in values]
    if missing or not callable_ or not values["ORDER"].isdigit():
        needed = ", ".join(missing) or (
            "an integer ORDER" if callable_ else "a function 'command' or 'app = typer.Typer('"
        )
        raise IncompleteCommand(f"{path.name}: a command without {needed}; add it on a line of its own")
    return CommandModule(path.stem, values["PART"], int(values["ORDER"]), values["SUMMARY"])
