"""Whether the residuals of the run contradict what is stated of the table, with stated and found values."""

from pipelines.jobs.references import UNITS, contradiction, references_of, unseen
from pipelines.report.context import ReportContext
from pipelines.report.numbers import significant
from pipelines.report.templates import fill
from pipelines.stages.uncertainty.tables import LABELS

ORDER = 26
TITLE = "Stated references"
TEMPLATE = """\
{% if judged.worse is none %}
<div class="verdict unjudged">Cannot be judged: {{ judged.reason }}.</div>
{% else %}
{% if judged.worse %}
<div class="verdict inadequate">Contradicted: {{ told }}.</div>
{% else %}
<div class="verdict adequate">Not contradicted: what the residuals of the units have in common is explained by the stated table.</div>
{% endif %}
<table>
<thead><tr><th>contribution</th><th>unit</th><th>stated u</th><th>found u</th><th>95 % interval</th><th>would be seen from (90 %)</th></tr></thead>
<tbody>
{% for one in judged.seen %}
<tr{% if one.worse %} class="fail"{% endif %}><td>{{ labels[one.entry] }}</td><td>{{ units.get(one.unit, one.unit) }}</td><td>{{ number(one.stated) }}</td>
<td>{{ number(one.found) }}</td><td>{{ number(one.low) }} to {{ "∞" if one.high is none else number(one.high) }}</td>
<td>{{ "–" if one.told_from is none else number(one.told_from) }}</td></tr>
{% endfor %}
</tbody>
</table>
<p>{{ unseen }}.</p>
{% endif %}
"""


def render(report: ReportContext) -> str | None:
    """The judgement with a row for each contribution; None where nothing is stated or no table turned the units."""
    judged = references_of(report.run)
    if judged is None:
        return None
    shown = unseen(judged)
    return fill(
        TEMPLATE,
        judged=judged,
        told=contradiction(judged),
        unseen=shown[:1].upper() + shown[1:],
        labels=LABELS,
        units=UNITS,
        number=significant,
    )
