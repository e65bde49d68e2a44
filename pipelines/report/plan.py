"""The page of a plan: one HTML file that opens without a network."""

from __future__ import annotations

from typing import Any

from pipelines.drawing import svg_text
from pipelines.planning.context import PlanContext
from pipelines.planning.documents import worst_axes
from pipelines.report.axes import side_by_side
from pipelines.report.budget_plots import shares_plot
from pipelines.report.numbers import scientific, significant
from pipelines.report.plan_pictures import alias_chart, sight_chart, sphere_chart, temperature_chart
from pipelines.report.templates import template
from schemas.decisions import LARGEST_ERROR


def render_plan(document: dict[str, Any], context: PlanContext) -> str:
    """The page as one HTML text that needs no other file.

    Parameters
    ----------
    document : of :func:`pipelines.planning.plan.plan`
    context : the recipe on the station
    """
    return template("plan.html").render(
        document=document,
        recipe=context.recipe,
        number=significant,
        scientific=scientific,
        coefficients=side_by_side(document["coefficients"], lambda row: significant(row["uncertainty_ug"]), "unit"),
        seen=[row for row in document["effects"] if row["seen"]],
        unseen=[row for row in document["effects"] if not row["seen"]],
        **pictures(document, context),
    )


def pictures(document: dict[str, Any], context: PlanContext) -> dict[str, str]:
    """The pictures of a plan by name, as SVG: poses, temperatures, remaining fractions, confounded effects."""
    aliases = alias_chart(context)
    return {
        "sphere": svg_text(sphere_chart(context)),
        "temperature": svg_text(temperature_chart(context)),
        "sights": svg_text(sight_chart(document["effects"])),
        "aliases": "" if aliases is None else svg_text(aliases),
        "budget": _budget(document.get("uncertainty")),
    }


def _budget(reach: dict[str, Any] | None) -> str:
    """Shares of the contributions to the reachable uncertainty, of the worst axis of each quantity; empty if none is stated."""
    if reach is None:
        return ""
    worst = worst_axes(reach)
    titles = {"bias_error": "error by the references", "bias_error_period": "error over the period"}
    worst.pop(LARGEST_ERROR, None)  # made of the same contributions
    return shares_plot(
        {f"{titles.get(q, q)}, {row['axis']}": row["shares"] for q, row in worst.items() if row["shares"]}
    )
