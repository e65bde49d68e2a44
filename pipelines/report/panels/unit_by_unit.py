"""The panels of each unit, in sections that can be opened."""

from pipelines.report.context import ReportContext
from pipelines.report.panel import rendered
from pipelines.report.templates import fill

ORDER = 50
TITLE = "Unit by unit"
UNIT_PANELS = "pipelines.report.unit_panels"
TEMPLATE = """\
{% for unit, panels in units %}
<details class="unit" id="{{ unit.unit }}"{% if loop.first or unit.outcome != "pass" %} open{% endif %}>
<summary>{{ unit.unit }} · slot {{ unit.slot }} · <span class="tag {{ unit.outcome }}">{{ unit.outcome }}</span> {{ unit.grade }}</summary>
{% if unit.outcome != "pass" %}
<h3>Why it {{ "was refused" if unit.outcome == "refused" else "failed" }}</h3>
<ul class="reasons">{% for reason in unit.reasons %}<li>{{ reason }}</li>{% else %}<li>no reason was recorded</li>{% endfor %}</ul>
{% endif %}
{% if unit.outcome == "refused" %}
<p class="note">A refused unit has no coefficients, figures, grade or certificate. Correct the cause and measure the unit again.</p>
{% endif %}
{% for title, panel in panels %}
<section class="{{ title | lower | replace(" ", "-") }}">
<h3>{{ title }}</h3>
{{ panel | safe }}
</section>
{% endfor %}
</details>
{% endfor %}
"""
FIRST = ("fail", "refused")


def render(report: ReportContext) -> str:
    """Every unit with the panels that have something to show; failed and refused units first, and open."""
    units = sorted(report.units, key=lambda unit: unit.outcome not in FIRST)
    shown = [(unit, [] if unit.outcome == "refused" else rendered(UNIT_PANELS, unit)) for unit in units]
    return fill(TEMPLATE, units=shown)
