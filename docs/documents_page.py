"""``python -m docs.documents_page``: the keys of the documents of ``--json``, from their types; ``--check`` only compares."""

from __future__ import annotations

import re
import sys
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NotRequired,
    Required,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from typing_extensions import is_typeddict

from docs.generated_page import write_or_check
from pipelines.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "decisions" / "documents.md"
BEGIN, END = "<!-- written by python -m docs.documents_page -->\n", "<!-- end of the written part -->\n"
COMMAND = re.compile(r"``([a-z]+)")
NAMES = {str: "text", bool: "true or false", int: "integer", float: "number", Any: "any", NoneType: "null"}


def documents() -> list[type]:
    """The type of every document that a command prints, in the order of the help.

    A document is a TypedDict in a module ``documents`` of a package of pipelines, or in a module of such a package; its docstring
    begins with the command.
    """
    places = [*ROOT.glob("pipelines/**/documents.py"), *ROOT.glob("pipelines/*/documents/*.py")]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in places]
    modules = [import_module(name) for name in names]
    types = {
        item
        for module in modules
        for item in vars(module).values()
        if is_typeddict(item) and item.__module__ == module.__name__ and command_of(item)
    }
    order = list(COMMANDS)
    return sorted(types, key=lambda one: (order.index(command_of(one)), len(head_of(one)), head_of(one)))


def command_of(kind: type) -> str:
    """The command at the start of the docstring of a document; empty for a part of a document."""
    match = COMMAND.match(kind.__doc__ or "")
    return match[1] if match else ""


def head_of(kind: type) -> str:
    """The command line in the docstring of a document."""
    return re.sub(r"\s+", " ", kind.__doc__ or "").split("``")[1]


def tables() -> str:
    """The sections of the documents, each with a table of keys."""
    return "\n".join(_section(kind) for kind in documents())


def _section(kind: type) -> str:
    head = head_of(kind)
    meaning = re.sub(r"\s+", " ", kind.__doc__ or "").split("``", 2)[2].removeprefix(":").strip().replace("``", "`")
    bases = [f"Also the keys of `{head_of(base)}`.\n" for base in _bases(kind)]
    lines = [f"## {head.replace(' --json', '')}\n", f"`{head}`: {meaning}\n", *bases]
    return "\n".join([*lines, "| key | value | meaning |", "|---|---|---|", *_rows(kind, "", fixed=True), ""])


def _bases(kind: type) -> list[type]:
    """The documents whose keys a document includes."""
    return [base for base in getattr(kind, "__orig_bases__", ()) if is_typeddict(base) and command_of(base)]


def _rows(kind: type, prefix: str, *, fixed: bool) -> list[str]:
    rows: list[str] = []
    hints = get_type_hints(kind, include_extras=True)
    for base in _bases(kind):
        hints = {name: hint for name, hint in hints.items() if name not in get_type_hints(base)}
    for name in sorted(hints, key=lambda name: not _unwrapped(hints[name])[2]):
        hint, meaning, required = _unwrapped(hints[name])
        required = fixed and required
        key = f"**`{prefix}{name}`**" if required else f"`{prefix}{name}`"
        rows.append(f"| {key} | {_text(hint)} | {meaning} |")
        for part, mark in _parts(hint):
            rows += _rows(part, f"{prefix}{name}{mark}.", fixed=required)
    return rows


def _unwrapped(hint: Any) -> tuple[Any, str, bool]:
    """A type without annotations, its meaning, and whether it is required."""
    meaning, required = "", True
    while get_origin(hint) in (Annotated, NotRequired, Required):
        required = required and get_origin(hint) is not NotRequired
        if get_origin(hint) is Annotated:
            meaning = next((one for one in hint.__metadata__ if isinstance(one, str)), meaning)
        hint = get_args(hint)[0]
    return hint, meaning, required


def _parts(hint: Any) -> list[tuple[type, str]]:
    """The documents inside a type, with the mark of their container: ``[]`` for a list, ``{}`` for values by name."""
    if _is_object(hint):
        return [] if command_of(hint) else [(hint, "")]
    marks = {list: "[]", tuple: "[]", dict: "{}"}
    mark = marks.get(get_origin(hint), "")
    return [(kind, mark + below) for one in get_args(hint) for kind, below in _parts(_unwrapped(one)[0])]


def _is_object(hint: Any) -> bool:
    """Whether a type is an object in JSON: a TypedDict, or the dataclass that it is made from."""
    return is_typeddict(hint) or is_dataclass(hint)


def _text(hint: Any) -> str:
    """The description of a type."""
    origin, arguments = get_origin(hint), get_args(hint)
    if _is_object(hint):
        return f"document of `{head_of(hint)}`" if command_of(hint) else "object"
    if origin in (list, tuple):
        return f"list of {_text(arguments[0])}"
    if origin is dict:
        return f"{_text(arguments[1])} by name"
    if origin is Literal:
        return " or ".join(f"`{value}`" for value in arguments)
    if origin in (Union, UnionType):
        return " or ".join(_text(one) for one in arguments)
    return NAMES[hint]


def page(text: str) -> str:
    """The page with its generated part replaced."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{tables()}\n{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    sys.exit(write_or_check(PAGE, page(PAGE.read_text(encoding="utf-8")), "docs.documents_page"))
