"""TOML files that people write: bounded reading, parsing, and the first problem of a model as one message."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from schemas.errors import RecipeInvalid, close_matches, did_you_mean
from schemas.foreign import foreign, shown
from schemas.serials import NEEDED, SERIAL_PATTERN
from schemas.shipped import hint_of_sample

AnyModel = TypeVar("AnyModel", bound=BaseModel)

LONGEST_FILE = 4 * 2**20  # bytes of a file that is written by hand
LONGEST_REASON = 400  # characters of the reason that a check gives
DEEPEST = 16  # levels of nested tables and lists; the deepest of our files has five


def read_text(path: Path, what: str, form: str = "TOML") -> str:
    """The content of a text file, with or without the mark that some editors begin UTF-8 with.

    The message names the file and what it should have been.
    """
    try:
        with path.open("rb") as file:
            data = file.read(LONGEST_FILE + 1)
        text = data.decode("utf-8-sig")
    except (OSError, ValueError) as problem:  # a name with a zero byte is a ValueError, too
        strerror = problem.strerror if isinstance(problem, OSError) else None
        reason = strerror or ("not UTF-8 text" if isinstance(problem, UnicodeDecodeError) else str(problem))
        sample = hint_of_sample(what, str(path)) if isinstance(problem, FileNotFoundError) else ""
        raise RecipeInvalid(
            f"{what}: {shown(str(path))} cannot be read ({reason}); give the path of a {what} file in {form}{sample}"
        ) from None
    if len(data) > LONGEST_FILE:
        raise RecipeInvalid(
            f"{what}: {shown(str(path))} has more than {LONGEST_FILE // 2**20} MiB, which no {what} file has; give the path of "
            f"a {what} file in {form}"
        )
    return text


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """The tables of a TOML text, or :class:`RecipeInvalid` with line and column."""
    with foreign(f"{source}: not valid TOML", "correct the file", RecipeInvalid):
        content = tomllib.loads(text)
    if _depth(content) > DEEPEST:
        raise RecipeInvalid(
            f"{source}: tables and lists more than {DEEPEST} deep in one another, none needs so many; correct the file"
        )
    return content


def parse_as(kind: type[AnyModel], text: str, source: str, context: Any = None) -> AnyModel:
    """The content of a TOML text as a model, or :class:`RecipeInvalid` naming the key and what is needed."""
    try:
        return kind.model_validate(parse_toml(text, source), context=context)
    except ValidationError as problem:
        raise explain(problem, source, kind) from None


def _depth(content: Any) -> int:
    """How deep lists and tables lie in one another, found level by level, without recursion."""
    level, depth = [content], 0
    while level and depth <= DEEPEST:
        inner = [v for part in level for v in (part.values() if isinstance(part, dict) else part)]
        level, depth = [v for v in inner if isinstance(v, dict | list)], depth + 1
    return depth


def explain(problem: ValidationError, source: str, model: type[BaseModel]) -> RecipeInvalid:
    """The first problem of a file as one message: key, value, what is needed, close matches.

    An unknown key is reported first: it is mostly the cause of the missing one.
    """
    # of a key that may be a text or a list, that a list is no text says nothing of what is wrong in it
    details = sorted(
        problem.errors(include_url=False),
        key=lambda d: (d["type"] != "extra_forbidden", d["type"] == "string_type" and isinstance(d["input"], list)),
    )
    first = details[0]
    # branches of a union are left out, which the file's author never wrote
    location = [part for part in first["loc"] if not (isinstance(part, str) and (part == "str" or "[" in part))]
    key = shown(".".join(map(str, location)))
    if first["type"] == "extra_forbidden":
        known = _fields_at(model, first["loc"][:-1])
        wrong = str(first["loc"][-1])
        message = f"{source}: unknown key {_named(location)}; {did_you_mean(wrong, known)}"
        return RecipeInvalid(message, key=key, close=close_matches(wrong, known))
    return RecipeInvalid(f"{source}: {_sentence(first, _named(location))}", key=key)


def _named(location: Sequence[int | str]) -> str:
    """A key by its names and the numbers, from 1, in the lists on the way: ``'faults.kind', number 2``; empty for the file."""
    names = ".".join(part for part in location if isinstance(part, str))
    numbers = ".".join(str(part + 1) for part in location if isinstance(part, int))
    return f"'{shown(names)}'{f', number {numbers}' if numbers else ''}" if location else ""


def _sentence(detail: ErrorDetails, key: str) -> str:
    if detail["type"] == "missing":
        return f"key {key} is missing; add it"
    reason = shown(reason_of(detail), LONGEST_REASON)
    if not key:
        return reason
    value = detail["input"]
    if isinstance(value, dict) or (isinstance(value, list) and (value or detail["type"] == "value_error")):
        return f"key {key}: {reason}"
    text = f"'{shown(value)}'" if isinstance(value, str) else shown(value)
    return f"key {key}: found {text}: {reason[:1].lower()}{reason[1:]}"


def _fields_at(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Names of the keys allowed at a location of a model, walking through lists, mappings and optional parts."""
    for part in location:
        field = model.model_fields.get(str(part))
        if field is None:
            continue
        inner = models_in(field.annotation)
        if inner:
            model = inner[0]
    return list(model.model_fields)


def models_in(annotation: object) -> list[type[BaseModel]]:
    """The models in an annotation, at any depth."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in getattr(annotation, "__args__", ()) for model in models_in(inner)]


PATTERNS = {
    SERIAL_PATTERN: NEEDED,
    r"^[a-z0-9][a-z0-9._-]*$": "small letters a to z, digits and . _ - are needed, a letter or digit first",
    r"^[a-z][a-z0-9_]*$": "small letters a to z, digits and _ are needed, a letter first",
    r"^([A-Za-z][A-Za-z0-9_]*)?$": "letters A to Z, digits and _ are needed, a letter first",
    r"^([0-9a-f]{64})?$": "64 of the digits 0 to 9 and a to f are needed, as sha256sum prints them",
    r"^([^{}]*\{[^{}]*\}[^{}]*)?$": "a text with one pair of braces is needed, where the value is put",
    r"^(\d{4}-\d\d-\d\d)?$": "a date as 2026-05-17 is needed",
    r"^[^@\s]+@[^@\s]+$": "an address as name@example.org is needed",
    r"^[A-Z]{2}$": "two capitals are needed, the code of the country after ISO 3166",
}
"""What each pattern asks for; a test finds a pattern that is not here."""


def reason_of(detail: ErrorDetails) -> str:
    """The reason of one problem that a model found."""
    context = detail.get("ctx", {})
    needed = PATTERNS.get(context.get("pattern", ""), "")
    if detail["type"] in {"too_short", "string_too_short"}:
        what = "entries" if detail["type"] == "too_short" else "characters"
        needed = f"{context['min_length']} or more {what} are needed; fill it in"
    if detail["type"] == "string_type":
        needed = "a text in quotes is needed; correct it"
    if detail["type"] in {"list_type", "tuple_type"}:
        needed = "a list in brackets is needed, as [1, 2]; correct it"
    return needed or detail["msg"].removeprefix("Value error, ")
