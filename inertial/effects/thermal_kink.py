from dataclasses import replace
from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class ThermalKink(SensorEffect):
    """Bias whose slope over temperature changes at one temperature."""

    id: ClassVar[str] = "thermal_kink"
    symbol: ClassVar[str] = "kK"
    equation: ClassVar[str] = "kK·w·softplus((T − Tc)/w)"
    coefficients: ClassVar[tuple[str, ...]] = ("kK",)
    source: ClassVar[str] = "mechanism: glass transition of an adhesive"
    typical_ug: ClassVar[tuple[float, float]] = (50.0, 5000.0)
    per: ClassVar[tuple[str, ...]] = ("K",)
    hides_behind: ClassVar[tuple[str, ...]] = ("bias_temperature_cubic", "bias_temperature_quadratic")
    breaker: ClassVar[str] = "steps of 5 K about the kink"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 25
    after: ClassVar[tuple[str, ...]] = ("bias_temperature",)
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (
        Nonlinear("centre", "degC", -40.0, 85.0, "linear", 12),
        Nonlinear("width", "K", 0.5, 8.0, "log", 3),
    )

    def columns(self, state: State, axis: int, *, centre: float, width: float, **nonlinear: float) -> Array:
        temperature = state.need("temperature", self.id)
        above = (temperature - centre) / width
        # np.logaddexp takes ten times as long
        return stack(state, [width * (np.maximum(above, 0.0) + np.log1p(np.exp(-np.abs(above))))])

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        """The kink between the run's extreme temperatures: beyond them it is a straight line."""
        centre, width = self.nonlinear
        temperature = state.need("temperature", self.id)
        low, high = float(np.min(temperature)), float(np.max(temperature))
        margin = 0.05 * max(high - low, 1.0)
        return replace(centre, low=low + margin, high=max(high - margin, low + 2.0 * margin)), width
