"""Dependence of the bias on any other recorded quantity: humidity, pressure, heater current."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State

COVARIATE_PREFIX = "covariate:"

_FEW = 7
"""Below this many distinct values a curve is not told from a line."""


class Covariate(SensorEffect):
    """Dependence of the bias on a recorded column: a line, or a smooth curve where the column takes enough values.

    The curve is a cubic with Legendre polynomials over the range met in the run; beyond that range it is not to be trusted.
    """

    symbol: ClassVar[str] = "kc"
    equation: ClassVar[str] = "kc1·z + kc2·P2(z) + kc3·P3(z), z the column scaled to −1 … 1"
    source: ClassVar[str] = "an empirical dependence: no physics is claimed"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 10000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ()
    breaker: ClassVar[str] = "vary this quantity alone"
    simplicity: ClassVar[int] = 60
    primary: ClassVar[int | None] = 1

    def __init__(self, column: str, *, curve: bool = True) -> None:
        self.column = column
        self.curve = curve
        self.id = f"{COVARIATE_PREFIX}{column}"  # type: ignore[misc]  # one id per column, not per class

    def constants(self, state: State) -> Mapping[str, float]:
        """Centre and half range of the column in the run, and the degree that its distinct values allow."""
        values = state.need(self.column, self.id)
        low, high = float(np.min(values)), float(np.max(values))
        many = np.unique(np.round(values, 9)).size >= _FEW
        return {
            "centre": 0.5 * (low + high),
            "half_range": max(0.5 * (high - low), 1e-12),
            "degree": 3.0 if self.curve and many else 1.0,
        }

    def columns(
        self, state: State, axis: int, *, centre: float, half_range: float, degree: float, **nonlinear: float
    ) -> Array:
        """Legendre polynomials of the scaled column, (..., n, degree)."""
        del axis, nonlinear
        z = (state.need(self.column, self.id) - centre) / half_range
        polynomials = [z, 1.5 * z**2 - 0.5, 2.5 * z**3 - 1.5 * z]
        return stack(state, polynomials[: int(degree)])

    def names(self, axis: int) -> tuple[str, ...]:
        """Names of the coefficients."""
        del axis
        return ("kc1", "kc2", "kc3") if self.curve else ("kc1",)
