"""Coefficients of a unit with their expanded uncertainty."""

from collections.abc import Mapping
from typing import Any

from pipelines.report.context import UnitContext
from pipelines.report.numbers import axes_of, side_by_side, with_uncertainty
from pipelines.report.templates import fill
from pipelines.tables.frames import rows_of

ORDER = 30
TITLE = "Coefficients"
TEMPLATE = """\
<table>
<tr><th>effect</th>{% for axis in axes %}<th class="n">{{ axis }}</th>{% endfor %}<th>unit</th></tr>
{% for line in lines %}
<tr><td>{{ line.effect }}</td>
{% if "*" in line.cells %}<td class="n" colspan="{{ axes | length }}">{{ line.cells["*"].name }} = {{ line.cells["*"].value }}</td>
{% else %}{% for axis in axes %}<td class="n"><small>{{ line.cells[axis].name }}</small> {{ line.cells[axis].value }} <small>± {{ line.cells[axis].uncertainty }}</small></td>{% endfor %}{% endif %}
<td>{{ line.unit }}</td></tr>
{% endfor %}
</table>
<p class="note">output = Σ coefficient · column, temperatures counted from 25 °C; ± is U with k = {{ coverage }}, lack of fit included; that of the bias by measurand is below.</p>
"""


def render(unit: UnitContext) -> str | None:
    """One line per coefficient with its three axes side by side; None without a fitted model."""
    if unit.tables["coefficients"].empty:
        return None
    coverage = unit.report.coverage

    def cell(row: Mapping[str, Any]) -> dict[str, str]:
        value, expanded = with_uncertainty(row["value"], coverage * row["standard_error"])
        return {"name": row["name"], "value": value, "uncertainty": expanded}

    lines = side_by_side(rows_of(unit.tables["coefficients"]), cell)
    return fill(TEMPLATE, lines=lines, axes=axes_of(lines), coverage=f"{coverage:g}")
