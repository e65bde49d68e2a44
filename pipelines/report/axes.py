"""Coefficients with their axes side by side, one line each, for tables of pages and of the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any


def side_by_side(
    rows: Iterable[Mapping[str, Any]], cell: Callable[[Mapping[str, Any]], Any], unit: str = "unit_text"
) -> list[dict[str, Any]]:
    """Lines with ``effect``, ``unit``, ``names`` of the coefficient and ``cells`` by axis; ``*`` for one that axes share.

    Parameters
    ----------
    rows : in the order of a fit: the k-th coefficient of an effect on each axis is in its k-th line
    cell : the entry of a row
    unit : the key of its unit
    """
    lines: dict[tuple[str, int], dict[str, Any]] = {}
    count: Counter[tuple[str, str]] = Counter()
    for row in rows:
        effect, axis = str(row["effect"]), str(row["axis"])
        new = {"effect": effect, "unit": row[unit], "names": [], "cells": {}}
        line = lines.setdefault((effect, count[effect, axis]), new)
        count[effect, axis] += 1
        line["cells"][axis] = cell(row)
        line["names"] += [] if row["name"] in line["names"] else [row["name"]]
    return list(lines.values())
