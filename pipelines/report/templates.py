"""The templates of pages, in this folder with one common style, and those in the modules of panels."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template


@cache
def _environment() -> Environment:
    loader = FunctionLoader(lambda part: (files("pipelines.report") / part).read_text(encoding="utf-8"))
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def template(name: str) -> Template:
    """The template of this name, which may include others of this folder."""
    return _environment().get_template(name)


def fill(text: str, **values: Any) -> str:
    """A template's text with its values; values that are not marked safe are escaped."""
    return _compiled(text).render(**values)


@cache
def _compiled(text: str) -> Template:
    return _environment().from_string(text)
