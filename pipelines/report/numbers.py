"""Numbers for people: as many digits as their uncertainty supports, no more; columns of numbers side by side."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from typing import Any, Literal

from inertial.uncertainty.rounding import rounded
from schemas.units import axes_among

MINUS = "−"
THIN = "\u202f"  # narrow no-break space between groups of three digits


def significant(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, in fixed notation where that is short."""
    if not math.isfinite(value):
        return ""
    if value == 0.0:
        return "0"
    places = digits - 1 - math.floor(math.log10(abs(value)))
    return _fixed(value, places) if places <= 8 else _signed(f"{value:.{digits - 1}e}")


def scientific(value: float, number: Callable[[float], str] = significant) -> str:
    """A number for people, from a million on as a power of ten; ``number`` formats smaller values."""
    if abs(value) < 1e6:
        return number(value)
    exponent = math.floor(math.log10(abs(value)))
    return f"{value / 10.0**exponent:.2f}·10{str(exponent).translate(str.maketrans('0123456789', '⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def with_uncertainty(value: float, expanded: float) -> tuple[str, str]:
    """Value and expanded uncertainty, the uncertainty to two digits and the value to the same decimal (GUM 7.2.6)."""
    if not math.isfinite(expanded) or expanded <= 0.0:
        return significant(value, 4), ""
    if expanded < 1e-7:
        return _signed(f"{value:.3e}"), _signed(f"{expanded:.1e}")
    shown, u = (_signed(f"{Decimal(text):,f}".replace(",", THIN)) for text in rounded(value, expanded))
    return shown, u


def _fixed(value: float, places: int) -> str:
    return _signed(f"{round(value, places) + 0.0:,.{max(places, 0)}f}".replace(",", THIN))


def _signed(text: str) -> str:
    return text.replace("-", MINUS)


def side_by_side(
    rows: Iterable[Mapping[str, Any]], cell: Callable[[Mapping[str, Any]], Any], unit: str = "unit_text"
) -> list[dict[str, Any]]:
    """Lines with ``effect``, ``unit``, ``names`` of the coefficient and ``cells`` by axis; ``*`` for a coefficient of all axes.

    ``title`` is the effect, with the names where it has several lines.

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
    several = {effect for effect, number in lines if number > 0}
    for line in lines.values():
        names = f" {', '.join(line['names'])}" if line["effect"] in several else ""
        line["title"] = f"{line['effect']}{names}"
    return list(lines.values())


def axis_word(axis: str) -> str:
    """An axis for people: the figure that is called ``norm`` is of all axes that the device has, be they one, two or three."""
    return "all" if axis == "norm" else axis


def axes_of(lines: Iterable[Mapping[str, Any]]) -> list[Literal["x", "y", "z"]]:
    """The sensor axes that have a cell in one of the lines, in order."""
    return axes_among(axis for line in lines for axis in line["cells"])
