"""Dependence of the bias on any other recorded quantity: humidity, pressure, heater current."""

from collections.abc import Mapping

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.splines import natural_spline
from inertial.state import State

COVARIATE_PREFIX = "covariate:"

_KNOTS = np.linspace(-1.0, 1.0, 6)
_FEW = 8
"""Below this many distinct values a curve cannot be distinguished from a line."""


class Covariate(SensorEffect):
    """Dependence of the bias on a recorded column: a line, or a smooth curve where the column takes enough values.

    The curve is a natural cubic spline over the range met in the run, straight beyond it.
    """

    symbol = "kc"
    equation = "kc1·z + Σ kcj·Nj(z), z the column scaled to −1 … 1, Nj a natural cubic spline"
    source = "an empirical dependence: no physics is claimed"
    typical_ug = (1.0, 10000.0)
    breaker = "vary this quantity alone"
    same_on_axes = True
    simplicity = 60
    primary = 1

    def __init__(self, column: str) -> None:
        self.column = column
        self.id = f"{COVARIATE_PREFIX}{column}"  # type: ignore[misc]  # one id per column, not per class

    def constants(self, state: State) -> Mapping[str, float]:
        """Centre and half range of the column in the run, and the degree that its distinct values allow."""
        values = state.need(self.column, self.id)
        low, high = float(np.min(values)), float(np.max(values))
        many = np.unique(np.round(values, 9)).size >= _FEW
        return {
            "centre": 0.5 * (low + high),
            "half_range": max(0.5 * (high - low), 1e-12),
            "degree": float(_KNOTS.size - 1) if many else 1.0,
        }

    def columns(
        self, state: State, axis: int, *, centre: float, half_range: float, degree: float, **nonlinear: float
    ) -> Array:
        """A line, and the curved functions of the spline, of the scaled column: (..., n, degree)."""
        z = (state.need(self.column, self.id) - centre) / half_range
        return stack(state, [z, *natural_spline(z, _KNOTS)][: int(degree)])

    def names(self, axis: int) -> tuple[str, ...]:
        """Names of the coefficients."""
        return tuple(f"kc{k + 1}" for k in range(_KNOTS.size - 1))

    def names_at(self, axis: int, **nonlinear: float) -> tuple[str, ...]:
        """Names of the coefficients that the column's values in the run allow."""
        names = self.names(axis)
        return names[: int(nonlinear.get("degree", len(names)))]
