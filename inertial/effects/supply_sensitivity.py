from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class SupplySensitivity(SensorEffect):
    """Bias and scale factor that follow the supply voltage."""

    id: ClassVar[str] = "supply_sensitivity"
    symbol: ClassVar[str] = "kV"
    equation: ClassVar[str] = "kV·ΔV + K1V·ΔV·(fi + δj·fj + δk·fk)"
    coefficients: ClassVar[tuple[str, ...]] = ("kV", "K1V")
    source: ClassVar[str] = "mechanism: ratiometric output; power-supply rejection"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 5000.0)
    per: ClassVar[tuple[str, ...]] = ("V", "g·V")
    hides_behind: ClassVar[tuple[str, ...]] = ("bias_temperature",)
    breaker: ClassVar[str] = "steps of the supply at constant temperature"
    simplicity: ClassVar[int] = 35
    sharp: ClassVar[bool] = True
    primary: ClassVar[int | None] = 1

    def columns(self, state: State, axis: int, *, nominal: float, **nonlinear: float) -> Array:
        change = state.need("supply", self.id) - nominal
        return stack(state, [change, change * state.along(axis)])

    def constants(self, state: State) -> Mapping[str, float]:
        """The mean supply of the run, V: changes count from there."""
        return {"nominal": float(np.mean(state.need("supply", self.id)))}
