"""Figures of merit of a unit against their limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.report.numbers import plain, with_uncertainty
from pipelines.report.templates import fill
from pipelines.stages.figures import FIGURES
from pipelines.tables.frames import rows_of

if TYPE_CHECKING:
    from pipelines.report.context import UnitContext

ORDER = 20
TITLE = "Figures and limits"
TEMPLATE = """\
<table>
<tr><th>figure</th><th class="n">value</th><th class="n">± U <small>(k = {{ coverage }})</small></th><th class="n">limit</th><th class="n">margin</th><th>unit</th><th>result</th></tr>
{% for figure in figures %}
<tr><td>{{ figure.title }}</td><td class="n">{{ figure.value }}</td><td class="n">{{ figure.uncertainty }}</td><td class="n">{{ figure.limit }}</td><td class="n">{{ figure.margin }}</td>
<td>{{ figure.unit }}</td><td>{% if figure.outcome %}<span class="tag {{ figure.outcome.split(" ")[0] }}">{{ figure.outcome }}</span>{% else %}<small>no limit</small>{% endif %}</td></tr>
{% endfor %}
</table>
"""


def render(unit: UnitContext) -> str:
    """One line per figure."""
    lines = [_line(row) for row in rows_of(unit.tables["figures"])]
    return fill(TEMPLATE, figures=lines, coverage=f"{unit.report.coverage:g}")


def _line(row: dict[str, Any]) -> dict[str, Any]:
    value, expanded = with_uncertainty(row["value"], row["uncertainty"])
    limited = bool(np.isfinite(row["limit"]))
    return {
        "title": FIGURES[row["figure"]].label if row["figure"] in FIGURES else row["figure"],
        "value": value,
        "uncertainty": expanded,
        "limit": plain(row["limit"]) if limited else "",
        "margin": plain(row["limit"] - abs(row["value"])) if limited else "",
        "unit": "" if row["unit_text"] == "1" else row["unit_text"],
        "outcome": row["outcome"] if limited else "",
    }
