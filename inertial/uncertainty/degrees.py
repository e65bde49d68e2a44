"""Effective degrees of freedom, coverage factors and rounding (JCGM 100:2008, G.4, G.6.4, 7.2.6)."""

from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_HALF_UP, Decimal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

PROBABILITY = 0.9545
"""Of k = 2 for a normal distribution."""
_LARGEST = 1e9
FloatArray = NDArray[np.float64]


def welch_satterthwaite(u: Sequence[float], dof: Sequence[float]) -> float:
    """ν_eff = u_c⁴/Σ(u_i⁴/ν_i) (JCGM 100, G.2b); infinite where all are."""
    parts = np.asarray(u, dtype=float)
    below = float(np.sum(parts**4 / np.asarray(dof, dtype=float)))
    return float(np.sum(parts**2) ** 2 / below) if below > 0.0 else float("inf")


def effective_degrees(u: FloatArray, dof: FloatArray) -> FloatArray:
    """:func:`welch_satterthwaite` of every row: u and dof (n, c), result (n,)."""
    parts = np.ascontiguousarray(u, dtype=float)
    below = np.sum(np.ascontiguousarray(parts**4 / np.asarray(dof, dtype=float)), axis=1)
    whole = np.sum(np.ascontiguousarray(parts**2), axis=1) ** 2
    return np.divide(whole, below, out=np.full_like(below, np.inf), where=below > 0.0)


def coverage_factors(dof: FloatArray, probability: float = PROBABILITY) -> FloatArray:
    """:func:`coverage_factor` of every element."""
    finite = dof < _LARGEST
    whole = np.maximum(np.where(finite, dof, 1.0).astype(np.int64), 1)
    return np.where(finite, stdtrit(whole, 0.5 * (1.0 + probability)), ndtri(0.5 * (1.0 + probability)))


def coverage_factor(dof: float, probability: float = PROBABILITY) -> float:
    """K of Student's distribution for ν_eff truncated to a whole number (JCGM 100, G.4.1, table G.2); 2 for 95.45 % and ν = ∞."""
    if not dof < _LARGEST:
        return float(ndtri(0.5 * (1.0 + probability)))
    return float(stdtrit(max(int(dof), 1), 0.5 * (1.0 + probability)))


def from_reliability(relative: float) -> float:
    """Degrees of freedom of a standard uncertainty that is known within so large a share: ½·(Δu/u)⁻² (JCGM 100, G.3)."""
    return 0.5 / relative**2


def rounded(value: float, expanded: float) -> tuple[str, str]:
    """Value and expanded uncertainty as they are printed: U with two significant digits, the value to U's last digit.

    Half is rounded away from zero; a U that would lose more than 5 % is rounded up (JCGM 100, 7.2.6; ILAC-P14:09/2020).
    """
    if not (np.isfinite(value) and np.isfinite(expanded)):
        return f"{value:g}", f"{expanded:g}"
    if not expanded > 0.0:
        return f"{value:.4g}", "0"
    u = Decimal(repr(float(expanded)))
    place = u.adjusted() - 1
    shown = _to(u, place)
    if shown < u * Decimal("0.95"):
        shown = u.quantize(Decimal(1).scaleb(place), rounding=ROUND_CEILING)
    if shown.adjusted() - 1 > place:
        place = shown.adjusted() - 1
        shown = _to(shown, place)
    number = _to(Decimal(repr(float(value))), place)
    if number == 0:
        number = abs(number)
    return _text(number, place), _text(shown, place)


def _to(number: Decimal, place: int) -> Decimal:
    step = Decimal(1).scaleb(place)
    return (number / step).quantize(Decimal(1), rounding=ROUND_HALF_UP) * step


def _text(number: Decimal, place: int) -> str:
    return f"{number:.{max(-place, 0)}f}"
