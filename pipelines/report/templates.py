"""The pages' templates, which lie beside this module; they share one style."""

from __future__ import annotations

from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template


def template(name: str) -> Template:
    """The template of this name, which may include others that lie beside it."""
    loader = FunctionLoader(lambda part: (files("pipelines.report") / part).read_text(encoding="utf-8"))
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template(name)
