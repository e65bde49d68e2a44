"""Measurement and model, residuals, verification and Allan deviation of a unit."""

from pipelines.report.context import UnitContext
from pipelines.report.interactive import figure_of
from pipelines.report.run_pictures import check_chart, model_chart
from pipelines.report.templates import fill

ORDER = 10
TITLE = "Model and measurement"
TEMPLATE = """\
{{ model | safe }}
{{ checks | safe }}
{% if notes %}<p class="note">{{ notes | join(" ") }}</p>{% endif %}
"""
VERIFIED = "Grey band: error expected from the covariance of the coefficients and the wander of a dwell."
NOISE = "Allan deviation: band 68 % interval, line fitted terms where they explain the curve; dashed: slopes −½ and +½."


def render(unit: UnitContext) -> str | None:
    """Two rows of plots; None for a list of procedures without the multi-position test."""
    tables = unit.tables
    if tables["residuals"].empty:
        return None
    fitted = tables["dwells"][tables["dwells"]["kind"] == "dwell"]
    notes = [text for name, text in (("verification", VERIFIED), ("allan", NOISE)) if len(tables[name])]
    return fill(
        TEMPLATE,
        notes=notes,
        model=figure_of(model_chart(fitted, tables["residuals"])),
        checks=figure_of(check_chart(tables["residuals"], tables["verification"], tables["allan"])),
    )
