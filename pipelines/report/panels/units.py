"""Result, grade and main figures of every unit, with the reasons of each failure."""

from typing import Any

from pipelines.report.context import ReportContext, UnitContext
from pipelines.report.numbers import significant
from pipelines.report.reasons import grouped_reasons
from pipelines.report.templates import fill
from pipelines.tables.frames import rows_of

ORDER = 20
TITLE = "Units"
FIGURES = (
    "residual_rms_ug",
    "verification_norm_ug",
    "bias_error_ug",
    "zero_g_offset_mg",
    "velocity_random_walk_ug_rtHz",
    "bias_instability_ug",
)
TEMPLATE = """\
<table>
<tr><th class="n">slot</th><th>unit</th><th>result</th><th>grade</th>
<th class="n">fit<br><small>rms, µg</small></th><th class="n">verification<br><small>largest, of |a|, µg</small></th><th class="n">error<br><small>worst axis, µg</small></th>
<th class="n">zero-g offset<br><small>mg</small></th><th class="n">N<br><small>µg/√Hz</small></th><th class="n">B<br><small>µg</small></th></tr>
{% for unit in units %}
<tr><td class="n">{{ unit.slot }}</td><td><a href="#{{ unit.unit }}">{{ unit.unit }}</a></td>
<td><span class="tag {{ unit.outcome }}">{{ unit.outcome }}</span></td><td>{{ unit.grade }}</td>
{% for name in figures %}
<td class="n">{{ unit["values"].get(name, "") }}</td>
{% endfor %}</tr>
{% endfor %}
</table>
{% if groups %}<ul class="reasons">{% for group in groups %}<li>{{ group.sentence }}</li>{% endfor %}</ul>{% endif %}
<p class="note">Decided by {{ rule }}. fit: residual of the model on the poses it was fitted to. verification: largest error of the corrected
specific force (of the magnitude of three axes, along the axes of fewer) on poses that the fit has not used, mean over the dwells of a pose. N and B: noise of the worst
axis, an upper limit where the record does not identify the term.</p>
"""


def render(report: ReportContext) -> str:
    """One line per unit, by slot."""
    groups = grouped_reasons(rows_of(report.tables["grades"].sort_values("slot")))
    return fill(
        TEMPLATE, units=[_line(unit) for unit in report.units], groups=groups, figures=FIGURES, rule=report.rule
    )


def _line(unit: UnitContext) -> dict[str, Any]:
    figures = [] if unit.outcome == "refused" else rows_of(unit.tables["figures"])
    return {
        "unit": unit.unit,
        "slot": unit.slot,
        "outcome": unit.outcome,
        "grade": unit.grade,
        "values": {figure["figure"]: significant(figure["value"]) for figure in figures},
    }
