"""Figures of merit of a unit against their limits: three digits, as everywhere that a run is shown, and U to two."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipelines.report.context import UnitContext
from pipelines.report.numbers import significant
from pipelines.report.templates import fill
from pipelines.stages.figures import FIGURES
from pipelines.tables.frames import rows_of

ORDER = 20
TITLE = "Figures and limits"
TEMPLATE = """\
<table>
<tr><th>figure</th><th class="n">value</th><th class="n">± U <small>(k = {{ coverage }})</small></th><th class="n">limit</th><th class="n">margin</th><th>unit</th><th>result</th><th class="n">false decision, %</th></tr>
{% for figure in figures %}
<tr><td>{{ figure.title }}</td><td class="n">{{ figure.value }}</td><td class="n">{{ figure.uncertainty }}</td><td class="n">{{ figure.limit }}</td><td class="n">{{ figure.margin }}</td>
<td class="unit">{{ figure.unit }}</td><td>{% if figure.outcome %}<span class="tag {{ figure.outcome.split(" ")[0] }}">{{ figure.outcome }}</span>{% else %}<small>no limit</small>{% endif %}</td><td class="n">{{ figure.risk }}</td></tr>
{% endfor %}
</table>
<p class="note">False decision: probability that an accepted figure is beyond its limit (PFA), or one that is not accepted within it (PFR); JCGM 106, for this unit.</p>
"""


def render(unit: UnitContext) -> str:
    """One line per figure."""
    lines = [_line(row) for row in rows_of(unit.tables["figures"])]
    return fill(TEMPLATE, figures=lines, coverage=f"{unit.report.coverage:g}")


def _line(row: dict[str, Any]) -> dict[str, Any]:
    value, expanded = significant(row["value"]), significant(row["uncertainty"], 2) if row["uncertainty"] > 0.0 else ""
    limited = bool(np.isfinite(row["limit"]))
    least = float(row.get("least", np.nan))
    if np.isfinite(least):
        return _at_least(row, value, expanded, least)
    return {
        "title": FIGURES[row["figure"]].label if row["figure"] in FIGURES else row["figure"],
        "value": value,
        "uncertainty": expanded,
        "limit": significant(row["limit"]) if limited else "",
        "margin": significant(row["limit"] - abs(row["value"])) if limited else "",
        "unit": "" if row["unit_text"] == "1" else row["unit_text"],
        "outcome": row["outcome"] if limited else "",
        "risk": _risk(row) if limited else "",
    }


def _at_least(row: dict[str, Any], value: str, expanded: str, least: float) -> dict[str, Any]:
    """The line of a figure with a least value."""
    return {
        "title": FIGURES[row["figure"]].label if row["figure"] in FIGURES else row["figure"],
        "value": value,
        "uncertainty": expanded,
        "limit": f"≥ {significant(least)}",
        "margin": significant(row["value"] - least),
        "unit": "" if row["unit_text"] == "1" else row["unit_text"],
        "outcome": row["outcome"],
        "risk": _risk(row),
    }


def _risk(row: dict[str, Any]) -> str:
    """PFA of an accepted figure, PFR of one that is not; empty for runs of earlier versions."""
    if not np.isfinite(row.get("pfa", np.nan)):
        return ""
    name, value = ("PFA", row["pfa"]) if row["outcome"] == "pass" else ("PFR", row["pfr"])
    return f"{name} < 0.01" if value < 1e-4 else f"{name} {100.0 * value:.2g}"
