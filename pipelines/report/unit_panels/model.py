"""Measurement and model, residuals, verification and Allan deviation of a unit."""

from pipelines.report.context import UnitContext
from pipelines.report.effect_view import effect_chart
from pipelines.report.interactive import figure_of
from pipelines.report.model_view import model_view
from pipelines.report.run_pictures import check_chart, model_chart
from pipelines.report.templates import fill

ORDER = 10
TITLE = "Model and measurement"
TEMPLATE = """\
{{ view | safe }}
{% if before %}<p class="note">Before: what bias, scale and misalignment alone leave. After: what the model leaves.</p>{% endif %}
{{ model | safe }}
{{ checks | safe }}
{% if notes %}<p class="note">{{ notes | join(" ") }}</p>{% endif %}
"""
VERIFIED = "Grey band: error expected from the covariance of the coefficients and the wander of a dwell."
NOISE = "Allan deviation: band 68 % interval, line fitted terms where they explain the curve; dashed: slopes −½ and +½."


def render(unit: UnitContext) -> str | None:
    """The residual before and after, then two rows of plots and the checks; None for a list of procedures without the multi-position test."""
    tables = unit.tables
    if tables["residuals"].empty:
        return None
    fitted = tables["dwells"][tables["dwells"]["kind"] == "dwell"]
    notes = [text for name, text in (("verification", VERIFIED), ("allan", NOISE)) if len(tables[name])]
    effects = list(dict.fromkeys(tables["coefficients"]["effect"].astype(str)))
    view = model_view(unit.unit, fitted, tables["residuals"], effects)
    return fill(
        TEMPLATE,
        view=figure_of(effect_chart(view)),
        before=view.after is not None,
        notes=notes,
        model=figure_of(model_chart(fitted, tables["residuals"])),
        checks=figure_of(check_chart(tables["residuals"], tables["verification"], tables["allan"])),
    )
