"""The templates of pages, in this folder and in the modules of panels, with one style; reasons of decisions in words."""

from functools import cache
from hashlib import sha256
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template

from inertial import effects
from pipelines.report.interactive import scripts_hash
from pipelines.stages.figures import figure_label


@cache
def _environment() -> Environment:
    loader = FunctionLoader(lambda part: (files("pipelines.report") / part).read_text(encoding="utf-8"))
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    names: dict[str, Any] = {"plain_name": plain_name, "figure_label": figure_label}
    made.globals.update(names)
    return made


def plain_name(effect_id: str) -> str:
    """The plain name of an effect, for readers of a page; empty for an id that is not of the catalogue."""
    if effect_id not in effects.catalogue():
        return ""
    text = (type(effects.get(effect_id)).__doc__ or "").strip().splitlines()[:1]
    return text[0].partition(":")[0].rstrip(".") if text else ""


def template(name: str) -> Template:
    """The template of this name, which may include others of this folder."""
    return _environment().get_template(name)


@cache
def page_hash() -> str:
    """SHA-256 of the template, the style and the scripts of the page of a run."""
    folder = files("pipelines.report")
    parts = [(folder / name).read_bytes() for name in ("page.html", "style.css")]
    return sha256(b"".join([*parts, scripts_hash().encode()])).hexdigest()


def fill(text: str, **values: Any) -> str:
    """A template's text with its values; values that are not marked safe are escaped."""
    return _compiled(text).render(**values)


@cache
def _compiled(text: str) -> Template:
    return _environment().from_string(text)
