"""Figures of merit of a unit against their limits: three digits or as many as show the decision, U two."""

from typing import Any

import numpy as np

from pipelines.report.context import UnitContext
from pipelines.report.numbers import significant
from pipelines.report.templates import fill
from pipelines.stages.figures import figure_label
from pipelines.tables.frames import rows_of
from schemas.decisions import digits_beside

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
    least, most = float(row.get("least", np.nan)), float(row["limit"])
    edge = least if np.isfinite(least) else most
    limit = significant(edge, digits_beside(edge, edge))  # this and the margin are empty without a limit
    margin = significant(row["value"] - least if np.isfinite(least) else most - abs(row["value"]))
    return {
        "title": figure_label(row["figure"]),
        "value": significant(row["value"], digits_beside(row["value"], edge)),
        "uncertainty": significant(row["uncertainty"], 2) if row["uncertainty"] > 0.0 else "",
        "limit": f"≥ {limit}" if np.isfinite(least) else limit,
        "margin": margin,
        "unit": "" if row["unit_text"] == "1" else row["unit_text"],
        "outcome": row["outcome"] if limit else "",
        "risk": _risk(row) if limit else "",
    }


def _risk(row: dict[str, Any]) -> str:
    """PFA of an accepted figure, PFR of a rejected figure; empty for runs of earlier versions."""
    if not np.isfinite(row.get("pfa", np.nan)):
        return ""
    name, value = ("PFA", row["pfa"]) if row["outcome"] == "pass" else ("PFR", row["pfr"])
    return f"{name} < 0.01" if value < 1e-4 else f"{name} {100.0 * value:.2g}"
