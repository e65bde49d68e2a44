"""Numbers of a certificate: rounded for people, in SI units for XML."""

import math
from typing import NamedTuple

from inertial.uncertainty.rounding import rounded as printed
from schemas.units import STANDARD_GRAVITY_M_S2

MINUS = "\N{MINUS SIGN}"
_G = STANDARD_GRAVITY_M_S2
_ACCELERATION = r"\metre\second\tothe{-2}"


class SIUnit(NamedTuple):
    """A unit as D-SI writes it, and the factor to it."""

    text: str
    factor: float


def si_unit(unit: str) -> SIUnit | None:
    """The D-SI unit of a unit of the tables; None where there is none. D-SI has no standard gravity: per g becomes per m/s²."""
    if unit in _FIXED:
        return _FIXED[unit]
    head, _, below = unit.partition("/")
    if head not in _OUTPUT:
        return None
    text, factor = _OUTPUT[head]
    return _per(text, factor, below) if below else SIUnit(text, factor)


_OUTPUT = {
    "LSB": (r"\one", 1.0), "counts": (r"\one", 1.0), "V": (r"\volt", 1.0), "mV": (r"\volt", 1e-3), "mA": (r"\ampere", 1e-3),
    "A": (r"\ampere", 1.0), "g": (_ACCELERATION, _G), "m/s²": (_ACCELERATION, 1.0), "1": (r"\one", 1.0),
}  # fmt: skip
_FIXED = {
    "": SIUnit(r"\one", 1.0), "1": SIUnit(r"\one", 1.0), "ppm": SIUnit(r"\one", 1e-6), "%": SIUnit(r"\percent", 1.0),
    "µg": SIUnit(_ACCELERATION, 1e-6 * _G), "mg": SIUnit(_ACCELERATION, 1e-3 * _G), "m/s²": SIUnit(_ACCELERATION, 1.0),
    "µg/K": SIUnit(_ACCELERATION + r"\kelvin\tothe{-1}", 1e-6 * _G), "ppm/K": SIUnit(r"\kelvin\tothe{-1}", 1e-6),
    "µrad": SIUnit(r"\micro\radian", 1.0), "mrad": SIUnit(r"\milli\radian", 1.0), "rad": SIUnit(r"\radian", 1.0),
    "µg/√Hz": SIUnit(_ACCELERATION + r"\hertz\tothe{-0.5}", 1e-6 * _G), "°C": SIUnit(r"\degreecelsius", 1.0),
    "V": SIUnit(r"\volt", 1.0), "s": SIUnit(r"\second", 1.0), "K": SIUnit(r"\kelvin", 1.0), "min": SIUnit(r"\second", 60.0),
    "ms": SIUnit(r"\second", 1e-3), "Hz": SIUnit(r"\hertz", 1.0), "°": SIUnit(r"\degree", 1.0),
}  # fmt: skip


def _per(text: str, factor: float, below: str) -> SIUnit | None:
    """A unit per powers of g and K, such as ``g²·K``."""
    for piece in below.strip("()").replace("*", "·").split("·"):
        power = {"²": 2, "³": 3}.get(piece[-1:], 1)
        base = piece.rstrip("²³")
        if base == "g":
            text += rf"\metre\tothe{{-{power}}}\second\tothe{{{2 * power}}}"
            factor /= _G**power
        elif base == "K":
            text += rf"\kelvin\tothe{{-{power}}}"
        else:
            return None
    return SIUnit(text.removeprefix(r"\one") or text, factor)


def rounded(value: float, places: int) -> str:
    """A number with ``places`` decimal places; for negative ones the unknown digits are zeros."""
    text = f"{round(value, places):.{max(places, 0)}f}"
    return text.replace("-", MINUS) if float(text) != 0.0 else text.lstrip("-")


def with_uncertainty(value: float | None, expanded: float) -> tuple[str, str]:
    """A value and its U as they are printed: U with two digits, the value to the same place."""
    shown, u = (text.replace("-", MINUS) for text in printed(0.0 if value is None else value, expanded))
    return ("" if value is None else shown), u


def significant(value: float, digits: int = 3) -> str:
    """A number with given significant digits, without an exponent if it has few zeros."""
    if value == 0.0:
        return "0"
    if not math.isfinite(value):
        return "not known"
    places = digits - 1 - math.floor(math.log10(abs(value)))
    if -4 <= places <= 8:
        return rounded(value, places)
    return f"{value:.{digits - 1}e}".replace("-", MINUS)


LEAST = 1e-4
"""Smallest probability of false acceptance that is stated: a smaller one depends on the assumed tail of the distribution."""


def probability(value: float) -> str:
    """A probability in percent as text; "< 0.01 %" below :data:`LEAST`."""
    return "< 0.01 %" if value < LEAST else f"{100.0 * value:.2g} %"


def least_of(value: float) -> str:
    """The same as a number."""
    return f"< {LEAST:.0e}".replace("e-0", "e-") if value < LEAST else f"{value:.2g}"
