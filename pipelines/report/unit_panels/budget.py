"""Uncertainty of every quantity of a unit, with its largest contributions."""

import re
from typing import Any

import numpy as np

from inertial.uncertainty.rounding import rounded
from pipelines.report.context import UnitContext
from pipelines.report.numbers import axis_word, significant
from pipelines.report.templates import fill
from pipelines.stages.uncertainty.tables import LABELS, has_uncertainty
from pipelines.tables.frames import rows_of
from schemas.decisions import LARGEST_ERROR

ORDER = 47
TITLE = "Uncertainty"
NAMES = {
    "bias": "bias",
    "scale": "scale, relative",
    "misalignment": "misalignment",
    "bias_temperature": "bias over temperature",
    "scale_temperature": "scale over temperature",
    "orthogonality": "angle between axes, from 90°",
    "output": "corrected output, worst of the certified range",
    "bias_error": "error on poses not used, for the user",
    "verification_norm": "error of |a| on poses not used, worst pose",
    "bias_error_period": "error expected over the period of validity",
    LARGEST_ERROR: "largest error of the axes over the period of validity",
}
WITHOUT_VALUE = ("scale", "output")
TEMPLATE = """\
<table>
<tr><th>quantity</th><th>axis</th><th class="n">value</th><th class="n">u, type A</th><th class="n">u, type B</th><th class="n">ν<sub>eff</sub></th><th class="n">k</th><th class="n">U</th><th>unit</th><th>largest contributions</th></tr>
{% for line in lines %}
<tr{% if not line.worst %} class="other-axis"{% endif %}><td>{{ line.name }}</td><td>{{ line.axis }}</td><td class="n">{{ line.value }}</td><td class="n">{{ line.a }}</td><td class="n">{{ line.b }}</td><td class="n">{{ line.dof }}</td><td class="n">{{ line.k }}</td><td class="n">{{ line.expanded }}</td><td>{{ line.unit }}</td><td><small>{{ line.largest }}</small></td></tr>
{% endfor %}
</table>
<p class="note">Type A: noise of the run. Type B: references, station and device as stated. U = k·u, coverage about 95 %.<span class="print-only"> Printed: the axis with the largest U of each quantity; the page on a screen shows every axis.</span></p>
"""


def render(unit: UnitContext) -> str | None:
    """One line per quantity and axis; None where no uncertainty is stated."""
    rows = unit.tables.get("uncertainties")
    if rows is None or rows.empty:
        return None
    size = rows["expanded"].where(rows["expanded"] > 0.0, rows["value"])  # a standard deviation has no U
    worst = set(size.groupby(rows["quantity"], sort=False).idxmax())
    lines = [{**_line(row), "worst": at in worst} for at, row in zip(rows.index, rows_of(rows), strict=True)]
    return fill(TEMPLATE, lines=lines)


def _line(row: dict[str, Any]) -> dict[str, Any]:
    stated = has_uncertainty(row)
    value, expanded = (
        rounded(float(row["value"]), float(row["expanded"])) if stated else (significant(row["value"], 4), "")
    )
    return {
        "name": NAMES.get(row["quantity"], row["quantity"]),
        "axis": axis_word(row["axis"]),
        "value": "" if row["quantity"] in WITHOUT_VALUE else value,
        "a": significant(row["u_a"]) if stated else "",
        "b": significant(row["u_b"]) if stated else "",
        "dof": "" if not stated else "∞" if not np.isfinite(row["dof"]) or row["dof"] > 1e4 else f"{int(row['dof'])}",
        "k": f"{row['k']:.2f}" if stated else "",
        "expanded": expanded,
        "unit": row["unit_text"],
        "largest": without_nothing(row["largest"]),
    }


_NOTHING = re.compile(f", (?:{'|'.join(map(re.escape, LABELS.values()))}) 0 %")


def without_nothing(largest: str) -> str:
    """The largest contributions as they are listed, without those that round to 0 %."""
    return _NOTHING.sub("", largest)
