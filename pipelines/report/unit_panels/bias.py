"""Uncertainty of a unit's bias by measurand."""

from typing import Any

import numpy as np

from pipelines.report.context import UnitContext
from pipelines.report.numbers import axes_of, significant
from pipelines.report.templates import fill
from pipelines.tables.frames import rows_of

ORDER = 35
TITLE = "Uncertainty of the bias by measurand"
MEASURANDS = {
    "bias_record_u_ug": "mean of the record",
    "bias_long_u_ug": "mean of the day after the record",
    "bias_switch_on_u_ug": "mean of a day after the next switch-on",
}
TEMPLATE = """\
<table>
<tr><th>measurand</th>{% for axis in axes %}<th class="n">U {{ axis }}</th>{% endfor %}<th>unit</th></tr>
{% for line in lines %}
<tr><td>{{ line.name }}</td>{% for axis in axes %}<td class="n">{{ line.cells[axis] }}</td>{% endfor %}<td>µg</td></tr>
{% endfor %}
</table>
<p class="note">U with k = {{ coverage }}. The coefficient is the same for all; flicker and random walk between the record and the later time are added. The later
means hold for flicker, and for the random walk as far as the record shows one: of a walk that its flicker hides, nothing is carried beyond the record, and over a day it adds K·170 √s
(K in µg/√s); an Allan record of hours shows it. Not stated: no repeatability of switching on is known for this device.</p>
"""


def render(unit: UnitContext) -> str | None:
    """One line per measurand; None for runs of earlier versions, and for models without a bias."""
    rows = unit.tables.get("wander")
    if rows is None or rows.empty or "bias_record_u_ug" not in rows or not np.isfinite(rows["bias_record_u_ug"]).all():
        return None
    by_axis, coverage = {row["axis"]: row for row in rows_of(rows)}, unit.report.coverage
    lines: list[dict[str, Any]] = []
    for column, name in MEASURANDS.items():
        cells = {axis: significant(coverage * row[column]) or "not stated" for axis, row in by_axis.items()}
        lines.append({"name": name, "cells": cells})
    return fill(TEMPLATE, lines=lines, axes=axes_of(lines), coverage=f"{coverage:g}")
