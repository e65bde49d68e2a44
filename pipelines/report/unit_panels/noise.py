"""Noise terms of a unit's static record."""

from typing import Any

import numpy as np
import pandas as pd

from pipelines.report.context import UnitContext
from pipelines.report.numbers import axes_of, significant
from pipelines.report.templates import fill
from pipelines.tables.frames import rows_of

ORDER = 40
TITLE = "Noise of the static record"
NAMES = {
    "N": "N, velocity random walk (two-sided, IEEE 952)",
    "n_d": "n_d = N·√2, noise density (one-sided, data sheets)",
    "B": "B, bias instability",
    "K": "K, acceleration random walk",
    "Q": "Q, quantisation",
    "R": "R, ramp",
    "stability_1h": "bias stability over the last hour, standard deviation of 100 s means",
}
TEMPLATE = """\
<table>
<tr><th>term</th>{% for axis in axes %}<th class="n">{{ axis }}</th>{% endfor %}<th>unit</th></tr>
{% for line in lines %}
<tr><td>{{ line.name }}</td>{% for axis in axes %}<td class="n">{{ line.cells[axis] }}</td>{% endfor %}<td>{{ line.unit }}</td></tr>
{% endfor %}
</table>
<p class="note">In brackets: 95 % interval. ≤: not identified, upper limit. –: not determined.{% for note in notes %}<br>{{ note }}{% endfor %}</p>
"""


def render(unit: UnitContext) -> str | None:
    """One line per term with its three axes; None without a static record."""
    rows = unit.tables["noise"]
    lines: list[dict[str, Any]] = []
    for term, name in NAMES.items():
        of_term = rows[rows["term"] == term]
        if len(of_term):
            cells = {row["axis"]: _cell(row) for row in rows_of(of_term)}
            lines.append({"name": name, "unit": of_term["unit_text"].iloc[0], "cells": cells})
    notes = list(dict.fromkeys(_notes(rows)))
    return fill(TEMPLATE, lines=lines, axes=axes_of(lines), notes=notes) if lines else None


def _notes(rows: pd.DataFrame) -> list[str]:
    """Remarks on a unit's record besides its terms, with the axis."""
    if "note" not in rows:
        return []
    return [f"{row['axis']}: {row['note']}" for row in rows_of(rows) if str(row["note"]) not in {"", "nan"}]


def _cell(row: dict[str, Any]) -> str:
    if not row["identified"] and not np.isfinite(row["high"]):
        return "–"
    if not row["identified"]:
        return f"≤ {significant(row['high'])}"
    return f"{significant(row['value'])} ({significant(row['low'])} … {significant(row['high'])})"
