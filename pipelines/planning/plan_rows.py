"""Rows of a plan's document as its texts and pages show them."""

from __future__ import annotations

from typing import Any


def by_coefficient(rows: list[dict[str, Any]]) -> list[dict[str, dict[str, Any]]]:
    """The rows of the coefficients, by axis: one entry for each coefficient; of a parameter of the station, by ``*``."""
    entries: dict[tuple[str, int, bool], dict[str, dict[str, Any]]] = {}
    count: dict[tuple[str, str], int] = {}
    for row in rows:
        number = count.get((row["effect"], row["axis"]), 0)
        count[row["effect"], row["axis"]] = number + 1
        entries.setdefault((row["effect"], number, row["axis"] == "*"), {})[row["axis"]] = row
    return list(entries.values())


def worst_axes(reach: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The row with the largest uncertainty of each quantity that a plan can reach."""
    worst: dict[str, dict[str, Any]] = {}
    for row in reach["quantities"]:
        if row["quantity"] not in worst or row["u"] > worst[row["quantity"]]["u"]:
            worst[row["quantity"]] = row
    return worst
