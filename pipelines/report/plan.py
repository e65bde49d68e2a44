"""The page of a plan: one HTML file that opens without a network."""

from __future__ import annotations

from typing import Any

from pipelines.drawing import svg_text
from pipelines.planning.context import PlanContext
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
        coefficients=_coefficients(document["coefficients"]),
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
    worst: dict[str, dict[str, Any]] = {}
    for row in reach["quantities"]:
        if row["quantity"] not in worst or row["u"] > worst[row["quantity"]]["u"]:
            worst[row["quantity"]] = row
    titles = {"bias_error": "error by the references", "bias_error_period": "error over the period"}
    worst.pop(LARGEST_ERROR, None)  # made of the same contributions
    return shares_plot(
        {f"{titles.get(q, q)}, {row['axis']}": row["shares"] for q, row in worst.items() if row["shares"]}
    )


def _coefficients(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One line per coefficient, its axes side by side."""
    lines: dict[tuple[str, int, bool], dict[str, Any]] = {}
    count: dict[tuple[str, str], int] = {}
    for row in rows:
        place = count.get((row["effect"], row["axis"]), 0)
        count[row["effect"], row["axis"]] = place + 1
        shared = row["axis"] == "*"
        line = lines.setdefault(
            (row["effect"], place, shared), {"effect": row["effect"], "unit": row["unit"], "cells": {}, "names": []}
        )
        line["names"].append(row["name"])
        line["cells"]["x" if shared else row["axis"]] = significant(row["uncertainty_ug"])
    for line in lines.values():
        line["names"] = ", ".join(dict.fromkeys(line["names"]))
    return list(lines.values())
