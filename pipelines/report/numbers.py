"""Numbers for people: as many digits as their uncertainty supports, no more."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal

from inertial.uncertainty.rounding import rounded

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
    """Value and expanded uncertainty, the uncertainty to two digits and the value to the same place (GUM 7.2.6)."""
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
