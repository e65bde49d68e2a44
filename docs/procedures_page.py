"""``python -m docs.procedures_page``: the reference of test procedures, from their modules; ``--check`` only compares."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from docs.generated_page import cell, write_or_check
from inertial.dynamics.centrifuge_effects import EFFECTS as CENTRIFUGE_EFFECTS
from inertial.dynamics.rotation_effects import EFFECTS as ROTATION_EFFECTS
from inertial.dynamics.shock_effects import EFFECTS as SHOCK_EFFECTS
from inertial.dynamics.transfer_effects import EFFECTS
from pipelines.procedures import PROCEDURES, Procedure

PAGE = Path(__file__).resolve().parent / "reference" / "procedures.md"
RECIPES = PAGE.parents[2] / "deploy" / "recipes" / "procedures"
HEAD = """\
# Test procedures

Written by `python -m docs.procedures_page` from `pipelines/procedures/` and `inertial/dynamics/transfer_effects/`; change those
files, not this page. A recipe lists the procedures of a lot in order, as tables `[[procedures]]` with the key `kind`;
[how to](../how-to/list-procedures.md).
"""


def page() -> str:
    """The whole page as Markdown."""
    parts = [HEAD, *(_section(*named) for named in PROCEDURES.items()), _effects()]
    return "\n".join(parts)


def _section(name: str, one: Procedure) -> str:
    roles = ", ".join(f"`{role}`" for role in one.roles) or "table, chamber and reader"
    roles += "" if type(one).roles_for is Procedure.roles_for else " (`climate` where the part asks for another air)"
    lines = [f"## {name}", "", f"{one.title}: {one.states}.", "", f"Source: {one.source}. Station: {roles}.", ""]
    lines += [" ".join((one.part.__doc__ or "").split()), ""]
    if (RECIPES / f"{name}.toml").is_file():
        lines += [f"Sample: `tumbleline run deploy/recipes/procedures/{name}.toml`.", ""]
    fields = {key: field for key, field in one.part.model_fields.items() if key != "kind"}
    if fields:
        lines += ["| key | default |", "|---|---|"]
        lines += [f"| `{key}` | {'required' if f.is_required() else f'`{_default(f)}`'} |" for key, f in fields.items()]
        lines.append("")
    if one.figures:
        lines += ["| figure for limits | unit | meaning |", "|---|---|---|"]
        lines += [f"| `{f.name}` | {f.unit} | {f.meaning} |" for f in one.figures]
        lines.append("")
    return "\n".join(lines)


def _default(field: Any) -> Any:
    """The default of a key, also of one that is made anew each time."""
    return field.get_default(call_default_factory=True)


def _effects() -> str:
    model = """\
The model of a sweep is a sensitivity times effects; the diagnosis names those that are missing, and those that
the points do not separate."""
    lines: list[str] = []
    for title, what, effects in (
        ("transfer function", "factor", EFFECTS),
        ("shock comparison", "term", SHOCK_EFFECTS),
        ("centrifuge test", "term", CENTRIFUGE_EFFECTS),
        ("rotation", "term", ROTATION_EFFECTS),
    ):
        lines += [f"## Effects on a {title}", "", *([model, ""] if what == "factor" else [])]
        lines += [f"| effect | {what} | meaning | measurement that separates it from others |", "|---|---|---|---|"]
        named: dict[str, Any] = dict(effects)
        for name, one in named.items():
            lines.append(f"| `{name}` | {cell(one.equation)} | {(type(one).__doc__ or '').strip()} | {one.breaker} |")
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(write_or_check(PAGE, page(), "docs.procedures_page"))
