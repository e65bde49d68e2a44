"""Rows of a plan's document as its texts and pages show them."""

from __future__ import annotations

from typing import Any


def worst_axes(reach: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The row with the largest uncertainty of each quantity that a plan can reach."""
    worst: dict[str, dict[str, Any]] = {}
    for row in reach["quantities"]:
        if row["quantity"] not in worst or row["u"] > worst[row["quantity"]]["u"]:
            worst[row["quantity"]] = row
    return worst
