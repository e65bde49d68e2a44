"""``python -m docs.effects_page``: the reference of effects, written from the catalogue; ``--check`` only compares."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path

from docs.generated_page import cell, write_or_check
from inertial import effects
from inertial.effects.base import AnyEffect
from inertial.effects.covariate import Covariate
from inertial.effects.formula import Formula
from inertial.expressions import FORCES, FUNCTIONS, QUANTITIES

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "effects.md"
SCOPES = {
    "sensor": "Effects of the sensor: separate coefficients for every unit and axis",
    "slot": "Effects of the slots of the fixture",
    "station": "Effects of the station: common to all units of a run",
}
HEAD = """\
# Effects

This page lists the effects of the catalogue. `python -m docs.effects_page` writes it from their files. Ids are the
names in model files, on the command line and in JSON. i is the output axis, j and k the next two in the order x → y → z → x;
f is the specific force in g, θ the temperature above 25 °C, t the time, u the time since power-on, s the time since the last
move.
"""


def page() -> str:
    """The complete page as Markdown."""
    catalogue = sorted(effects.built_in().values(), key=lambda e: (list(SCOPES).index(e.scope), e.simplicity, e.id))
    parts = [HEAD, _table(catalogue)]
    for scope, title in SCOPES.items():
        parts.append(f"## {title}\n")
        parts += [_section(effect) for effect in catalogue if effect.scope == scope]
    return "\n".join([*parts, _covariates(), _formulas()])


def _table(catalogue: list[AnyEffect]) -> str:
    rows = [f"| [`{e.id}`](#{e.id}) | {cell(e.symbol)} | {cell(e.equation)} | {e.scope} |" for e in catalogue]
    return "\n".join(["| id | symbol | term | scope |", "|---|---|---|---|", *rows, ""])


def _section(effect: AnyEffect) -> str:
    low, high = effect.typical_ug
    lines = [
        f"### {effect.id}\n",
        f"{first_line(effect)}\n",
        f"- term: {effect.equation} ({effect.symbol})",
        f"- typical size: {low:g} to {high:g} µg",
        f"- source: {effect.source}",
    ]
    lines += [
        f"- {p.name}: between {p.low:g} and {p.high:g} {p.unit.removeprefix('1')}".rstrip()
        if not p.choices
        else f"- {p.name}: one of {', '.join(f'{c:g}' for c in p.choices)}"
        for p in effect.nonlinear
    ]
    if effect.hides_behind:
        lines.append(f"- confounded under poor plans with: {', '.join(f'`{name}`' for name in effect.hides_behind)}")
    lines.append(f"- becomes visible with: {effect.breaker}\n")
    return "\n".join(lines)


def first_line(effect: AnyEffect | type) -> str:
    """The first line of the docstring of an effect."""
    return (inspect.getdoc(effect) or "").partition("\n")[0]


def _covariates() -> str:
    lines = [
        "## covariate:&lt;column&gt;\n",
        f"{first_line(Covariate)}\n",
        "Every numeric column of the dwells without another meaning is a covariate.\n",
        f"- term: {Covariate.equation}",
        f"- becomes visible with: {Covariate.breaker}\n",
    ]
    return "\n".join(lines)


def _formulas() -> str:
    rows = [f"| `{name}` | {meaning} |" for name, meaning in FORCES.items()]
    rows += [f"| `{name}` | {meaning} |" for name, (_, _, meaning) in QUANTITIES.items()]
    functions = ", ".join(f"`{name}`" for name in FUNCTIONS)
    lines = [
        "## Formulas of a model file\n",
        f"{first_line(Formula)}\n",
        f"Allowed are numbers, `+ - * / **`, the functions {functions}, and these names:\n",
        "| name | meaning |",
        "|---|---|",
        *rows,
        "| any other | the recorded column with this name |",
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(write_or_check(PAGE, page(), "docs.effects_page"))
