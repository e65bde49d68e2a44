"""Coarse digits of an output: their effect on the white noise of its record, and the remark about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.noise.resolution import FINE, most, ripple, without_rounding
from inertial.noise.terms import NoiseTerms
from pipelines.stages.static_record import Digits

SHOWN = 0.02
"""Smallest share of rounding in the variance that is stated and subtracted."""


@dataclass(frozen=True)
class Coarse:
    """Digits of one channel, in µg.

    step : between two digits, zero if none is detected; variance : of a sample, as it came out, by the differences of neighbours
    most : largest standard deviation of a sample before rounding that such digits allow, 95 %
    """

    step: float
    variance: float
    most: float

    @classmethod
    def of(cls, digits: Digits, scale: float) -> Coarse:
        """Digits of a channel whose output is ``scale`` times µg."""
        step = digits.step / abs(scale)
        largest = most(step, digits.outside, digits.n) if step > 0.0 else np.inf
        return cls(step, digits.variance / scale**2, largest)

    @property
    def matters(self) -> bool:
        """Whether the share of rounding in the noise is large enough to state."""
        return self.step > 0.0 and self.step**2 / 12.0 > SHOWN * self.variance

    @property
    def spread(self) -> float:
        """Standard deviation of a sample before rounding by Sheppard's correction."""
        return float(np.sqrt(without_rounding(np.asarray(self.variance), np.asarray(self.step))))

    @property
    def correctable(self) -> bool:
        """Whether rounding adds the variance q²/12 and almost no other error."""
        return self.spread >= FINE * self.step


def remark(digits: Coarse) -> str:
    """The remark about N if the digits are coarse; else empty."""
    if not digits.matters:
        return ""
    step = f"the last digit is {digits.step:.3g} µg"
    if digits.correctable:
        return (
            f"{step}, {digits.step / digits.spread:.2g} of a sample's noise: its q²/12 is subtracted from N (Sheppard)"
        )
    return f"{step}, more than twice a sample's noise: N has only an upper limit; use a finer resolution"


def without_digits(terms: NoiseTerms, digits: Sequence[Coarse], rate_hz: float) -> NoiseTerms:
    """The terms (channels, 5) without the part of N that coarse digits make.

    Rounding adds q²/12 of white variance to a sample of noise above half a digit; its intervals are widened for the unknown place
    of the mean between two digits. Below that the output only shows how often the noise crossed to the next digit: N then has an
    upper limit.

    Parameters
    ----------
    rate_hz : of the samples that were rounded
    """
    n = terms.symbols.index("N")
    value, low, high = (part.copy() for part in (terms.value, terms.low, terms.high))
    for c, one in enumerate(digits):
        if not one.matters:
            continue
        if one.correctable:
            rounding, left = one.step**2 / 12.0, float(ripple(np.asarray(one.spread), np.asarray(one.step)))
            value[c, n] = _less(value[c, n], rounding, rate_hz)
            low[c, n] = _less(low[c, n], rounding + left, rate_hz)
            high[c, n] = _less(high[c, n], rounding - left, rate_hz)
        else:
            value[c, n], low[c, n] = np.nan, 0.0
            high[c, n] = max(high[c, n], one.most / np.sqrt(rate_hz))
    return replace(terms, value=value, low=low, high=high)


def _less(coefficient: float, variance: float, rate_hz: float) -> float:
    """N without some white variance of a sample."""
    return float(np.sqrt(max(coefficient**2 - variance / rate_hz, 0.0)))
