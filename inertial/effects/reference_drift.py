"""Reference that drifts while all units are measured."""

from inertial.effects.base import Array, Nonlinear, StationEffect
from inertial.operators import approach
from inertial.state import State


class ReferenceDrift(StationEffect):
    """Reference that drifts while all units are measured."""

    id = "reference_drift"
    symbol = "εt"
    equation = "f·(1 + εt·s), s = τ·(1 − exp(−t/τ))"
    coefficients = ("epsilon_t",)
    source = "mechanism: warm-up or ageing of the voltage reference of the reader"
    typical_ug = (1.0, 1000.0)
    hides_behind = ("scale_temperature", "scale_aging")
    breaker = "the first temperature again at the end, and a second reference beside the first"
    simplicity = 36
    nonlinear = (Nonlinear("settling_h", "h", 0.3, 30.0, "log", 5),)

    def force_change(self, state: State, *, settling_h: float, **nonlinear: float) -> Array:
        return approach(state.time / 3600.0, settling_h)[..., None, None] * state.force[..., None]
