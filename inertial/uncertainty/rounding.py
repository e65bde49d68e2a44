"""Rounding for print: of a value and its uncertainty (JCGM 100:2008, 7.2.6), of a number alone, and of a probability.

Commands that only print are to start quickly: this module imports no library of arrays.
"""

import math
from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_HALF_UP, Decimal


def rounded(value: float, expanded: float) -> tuple[str, str]:
    """Value and expanded uncertainty as they are printed: U with two significant digits, the value to U's last digit.

    Half is rounded away from zero; a U that would lose more than 5 % is rounded up (JCGM 100, 7.2.6; ILAC-P14:09/2020).
    """
    if not (math.isfinite(value) and math.isfinite(expanded)):
        return f"{value:g}", f"{expanded:g}"
    if not expanded > 0.0:
        return f"{value:.4g}", "0"
    u = Decimal(repr(float(expanded)))
    exponent = u.adjusted() - 1
    shown = _to(u, exponent)
    if shown < u * Decimal("0.95"):
        shown = u.quantize(Decimal(1).scaleb(exponent), rounding=ROUND_CEILING)
    if shown.adjusted() - 1 > exponent:
        exponent = shown.adjusted() - 1
        shown = _to(shown, exponent)
    number = _to(Decimal(repr(float(value))), exponent)
    if number == 0:
        number = abs(number)
    return _text(number, exponent), _text(shown, exponent)


def _to(number: Decimal, exponent: int) -> Decimal:
    step = Decimal(1).scaleb(exponent)
    return (number / step).quantize(Decimal(1), rounding=ROUND_HALF_UP) * step


def _text(number: Decimal, exponent: int) -> str:
    return f"{number:.{max(-exponent, 0)}f}"


LEAST_P = 1e-3
"""Below this a p is a score: noise that no list has reaches it by chance more often than it says."""


def chance(p: float | None) -> str:
    """A probability of so bad an agreement, with two digits, and nothing smaller than :data:`LEAST_P`; empty for None."""
    if p is None:
        return ""
    return f"< {LEAST_P:g}" if p < LEAST_P else f"{p:.2g}"


def equal(p: float | None) -> str:
    """The text of :func:`chance` after ``=``, or as it is where it begins with ``<``."""
    text = chance(p)
    return text if text.startswith("<") else f"= {text}"


def short(value: float | None, digits: int = 3) -> str:
    """A number for people: so many significant digits, without an exponent if possible, empty for None."""
    if value is None or not math.isfinite(value):
        return ""
    if value == 0.0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    if -3 <= decimals <= 6:
        return f"{round(value, decimals):.{max(decimals, 0)}f}"
    return f"{value:.{digits - 1}e}"


def short_values(value: float | Sequence[float] | None) -> str:
    """A number, or one per axis, for people."""
    if isinstance(value, list | tuple):
        return " / ".join(short(float(v)) for v in value)
    return short(value)  # pyright: ignore[reportArgumentType]  # not a sequence any more
