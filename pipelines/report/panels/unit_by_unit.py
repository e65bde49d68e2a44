"""The panels of each unit, in sections that can be opened."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.report.panel import rendered
from pipelines.report.templates import fill

if TYPE_CHECKING:
    from pipelines.report.context import ReportContext

ORDER = 50
TITLE = "Unit by unit"
UNIT_PANELS = "pipelines.report.unit_panels"
TEMPLATE = """\
{% for unit, panels in units %}
<details id="{{ unit.unit }}"{% if loop.first %} open{% endif %}>
<summary>{{ unit.unit }} · slot {{ unit.slot }} · <span class="tag {{ unit.outcome }}">{{ unit.outcome }}</span> {{ unit.grade }}</summary>
{% for title, panel in panels %}
<h3>{{ title }}</h3>
{{ panel | safe }}
{% endfor %}
</details>
{% endfor %}
"""


def render(report: ReportContext) -> str:
    """Every calibrated unit with its panels."""
    return fill(TEMPLATE, units=[(unit, rendered(UNIT_PANELS, unit)) for unit in report.calibrated])
