"""The keys of the files that a user writes: notation, default and meaning, from the classes that check them."""

import tomllib
from functools import cache
from importlib.resources import files
from types import NoneType
from typing import Any, Literal, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from schemas.limits import Limits
from schemas.line import Line
from schemas.recipe import RecipeFile
from schemas.stated import STATED, SYMBOLS
from schemas.station import StationConfig
from schemas.toml_files import models_in

FILES: dict[str, type[BaseModel]] = {"recipe": RecipeFile, "limits": Limits, "station": StationConfig, "line": Line}
"""The files whose keys are listed, by what a user calls them."""

FORMS = {
    "u": "Standard uncertainty",
    "U": "Expanded uncertainty",
    "half_width": "Half-width",
}
BESIDE = {"u": "", "U": "; its factor is 'k'", "half_width": "; its shape is 'distribution'"}
"""What a form of uncertainty refers to in the same table."""
PARTS = {"inl": "integral nonlinearity"}
"""Parts of an entry whose name in a key is no word."""
TABLES: dict[Any, str] = {list: "list of tables", dict: "tables by name"}
SHAPES: dict[Any, str] = {list: "list", tuple: "list", dict: "table"}
PLAIN = {float: "number", int: "integer", str: "text", bool: "true or false"}


class Key(NamedTuple):
    """One key: its table (empty: the top of the file), name, kind of value, default ('needed': none), and meaning."""

    table: str
    name: str
    value: str
    default: str
    meaning: str


def keys_of(model: type[BaseModel]) -> list[Key]:
    """The keys of a file: those of the file itself, and then table by table; a table that several keys have is listed once."""
    keys: list[Key] = []
    waiting: list[tuple[str, type[BaseModel]]] = [("", model)]
    listed: set[type[BaseModel]] = set()
    while waiting:
        table, table_model = waiting.pop(0)
        if table_model in listed:
            continue
        listed.add(table_model)
        for name, field in table_model.model_fields.items():
            below = models_in(field.annotation)
            default = "needed" if field.is_required() else _text(field.get_default(call_default_factory=True))
            value = _value(field.annotation)
            keys.append(Key(table, name, value, default, meaning(table_model, name)))
            dotted = f"{table}.{name}" if table else name
            waiting += [(dotted, part) for part in below]
    return keys


def meaning(model: type[BaseModel], name: str) -> str:
    """The meaning of a key; empty where ``key_texts.toml`` has none."""
    texts = _texts()
    for base in model.__mro__:
        for section in (f"{base.__name__}:{base.__module__}", base.__name__):
            if name in texts.get(section, {}):
                return texts[section][name]
    match = STATED.match(name)
    if match is None or match["unit"] not in SYMBOLS:
        return ""
    part = f" of the {PARTS.get(match['part'], match['part'])}" if match["part"] else ""
    return f"{FORMS[match['form']]}{part}, {SYMBOLS[match['unit']]}{BESIDE[match['form']]}."


@cache
def _texts() -> dict[str, dict[str, str]]:
    return tomllib.loads(files("schemas").joinpath("key_texts.toml").read_text("utf-8"))


def _value(annotation: Any) -> str:
    """The kind of a value in words."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if models_in(annotation):
        return TABLES.get(origin, "table")
    if origin is Literal:
        return " or ".join(f"{part}" if isinstance(part, int) else f"'{part}'" for part in parts)
    if origin in SHAPES:
        return f"list of {len(parts)}" if origin is tuple else SHAPES[origin]
    if parts:  # Annotated, or a union with None
        texts = [_value(part) for part in parts if isinstance(part, type) or get_args(part)]
        return " or ".join(dict.fromkeys(text for text in texts if text))
    return PLAIN.get(annotation, "" if annotation is NoneType else getattr(annotation, "__name__", "text"))


def _text(default: Any) -> str:
    """A default for people; empty where nothing is stated by default."""
    if default is None or default is PydanticUndefined or default in ("", [], {}) or isinstance(default, BaseModel):
        return ""
    if isinstance(default, bool):
        return "true" if default else "false"
    if isinstance(default, float):
        return f"{default:g}"
    if isinstance(default, list | tuple):
        return f"[{', '.join(_text(part) or '0' for part in default)}]"
    return str(default)
