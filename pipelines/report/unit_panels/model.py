"""Measurement and model, residuals, verification and Allan deviation of a unit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.report.plots import check_plots, model_plots
from pipelines.report.templates import fill

if TYPE_CHECKING:
    from pipelines.report.context import UnitContext

ORDER = 10
TITLE = "Model and measurement"
TEMPLATE = """\
{{ model | safe }}
{% if soaks > 1 %}<p class="note">Colours: temperature of the soak, from blue (cold) to red (warm).</p>{% endif %}
{{ checks | safe }}
{% if notes %}<p class="note">{{ notes | join(" ") }}</p>{% endif %}
"""
VERIFIED = "Grey band: error expected from the covariance of the coefficients and the wander of a dwell."
NOISE = "Allan deviation: band 68 % interval, line fitted terms where they explain the curve; dotted: slopes −½ and +½."


def render(unit: UnitContext) -> str | None:
    """Two rows of plots; None for a list of procedures without the multi-position test."""
    tables = unit.tables
    if tables["residuals"].empty:
        return None
    fitted = tables["dwells"][tables["dwells"]["kind"] == "dwell"]
    notes = [text for name, text in (("verification", VERIFIED), ("allan", NOISE)) if len(tables[name])]
    return fill(
        TEMPLATE,
        soaks=fitted["soak"].nunique(),
        notes=notes,
        model=model_plots(fitted, tables["residuals"]),
        checks=check_plots(tables["residuals"], tables["verification"], tables["allan"]),
    )
