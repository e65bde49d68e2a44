"""Figures, findings and pictures of a unit's test procedures."""

from typing import Any

import numpy as np
import pandas as pd

from pipelines.procedures import PROCEDURES
from pipelines.procedures.base import Evaluated
from pipelines.report.context import UnitContext
from pipelines.report.interactive import figure_of
from pipelines.report.numbers import significant, with_uncertainty
from pipelines.report.templates import fill
from pipelines.tables.frames import rows_of
from schemas.decisions import digits_beside

ORDER = 45
TITLE = "Test procedures"
TEMPLATE = """\
{% for one in procedures %}
<h4>{{ one.title }}</h4>
<table>
<tr><th>figure</th><th>axis</th><th class="n">value</th><th class="n">U</th><th class="n">95 % interval</th><th>unit</th><th class="n">limit</th><th>outcome</th></tr>
{% for line in one.lines %}
<tr><td>{{ line.meaning }}</td><td>{{ line.axis }}</td><td class="n">{{ line.value }}</td><td class="n">{{ line.spread }}</td><td class="n">{{ line.interval }}</td><td>{{ line.unit }}</td><td class="n">{{ line.limit }}</td><td>{{ line.outcome }}</td></tr>
{% if line.note %}<tr><td></td><td colspan="7">{{ line.note }}</td></tr>{% endif %}
{% endfor %}
</table>
{% if one.findings %}<ul>{% for text in one.findings %}<li>{{ text }}</li>{% endfor %}</ul>{% endif %}
{{ one.picture | safe }}
{% endfor %}
<p class="note">U with k = {{ coverage }}. Not determined: the records do not identify the figure; it passes no limit.</p>
"""


def render(unit: UnitContext) -> str | None:
    """Every procedure of the recipe's list that has figures; None for recipes without a list."""
    parts = unit.report.recipe.get("procedures") or []
    tables = unit.tables
    if not parts or "procedure_figures" not in tables:
        return None
    shown = [panel for number in range(len(parts)) if (panel := _procedure(unit, number, parts[number])) is not None]
    return fill(TEMPLATE, procedures=shown, coverage=f"{unit.report.coverage:g}") if shown else None


def _procedure(unit: UnitContext, number: int, content: dict[str, Any]) -> dict[str, Any] | None:
    figures, points = (unit.tables[name] for name in ("procedure_figures", "procedure_points"))
    figures, points = figures[figures["number"] == number], points[points["number"] == number]
    procedure = PROCEDURES.get(str(content.get("kind")))
    if not isinstance(procedure, Evaluated) or figures.empty:
        return None
    every_finding = unit.report.tables["procedure_findings"]
    findings = every_finding[(every_finding["number"] == number) & every_finding["unit"].isin([unit.unit, ""])]
    return {
        "title": procedure.title,
        "lines": [_line(unit, row, {f.name: f.meaning for f in procedure.figures}) for row in rows_of(figures)],
        "findings": [f"{row['subject']}: {row['text']}" for row in rows_of(findings)],
        "picture": picture(procedure, content, points) if len(points) else "",
    }


def picture(procedure: Evaluated, content: dict[str, Any], points: pd.DataFrame) -> str:
    """The procedure's chart of one unit; empty where its points are too few."""
    chart = procedure.chart(procedure.part.model_validate(content), points)
    return "" if chart is None else figure_of(chart)


def _line(unit: UnitContext, row: dict[str, Any], meanings: dict[str, str]) -> dict[str, Any]:
    known = bool(row["identified"])
    limit, least = unit.report.limit(row["figure"]), unit.report.limit(row["figure"], "min")
    limited = bool(np.isfinite(limit) or np.isfinite(least))
    decided = unit.tables["figures"]
    outcome = decided.loc[decided["figure"] == row["figure"], "outcome"].tolist()
    expanded = unit.report.coverage * row["uncertainty"]
    value, spread = with_uncertainty(row["value"], expanded)
    edge = limit if np.isfinite(limit) else least
    if limited and known:
        value = max(value, significant(row["value"], digits_beside(row["value"], edge, 1)), key=len)
    limit_text = significant(edge, digits_beside(edge, edge))
    ends = [row["low"], row["high"]]
    interval = " … ".join(with_uncertainty(end, expanded)[0] for end in ends) if np.isfinite(ends).all() else ""
    return {
        "meaning": meanings.get(row["figure"], row["figure"]),
        "axis": row["axis"],
        "value": value if known else "not determined",
        "spread": spread if known else "",
        "interval": interval,
        "unit": row["unit_text"],
        "limit": limit_text if np.isfinite(limit) or not limited else f"≥ {limit_text}",
        "outcome": (outcome[0] if outcome else "fail") if limited else "",
        "note": row["note"],
    }
