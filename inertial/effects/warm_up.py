import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.power import coldness, since_first
from inertial.state import State


class WarmUp(SensorEffect):
    """Bias that settles after power-on."""

    id = "warm_up"
    symbol = "kW"
    equation = "kW·exp(−u/τ)"
    coefficients = ("kW",)
    source = "mechanism: self-heating; IEEE Std 1293-1998, warm-up"
    typical_ug = (10.0, 10000.0)
    hides_behind = ("aging_linear", "aging_log")
    breaker = "a power cycle at constant temperature"
    same_on_axes = True
    simplicity = 26
    nonlinear = (Nonlinear("tau", "s", 10.0, 7200.0, "log", 14),)

    def columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:
        since = since_first(state) if state.since_power is None else state.since_power
        return stack(state, [coldness(state, tau) * np.exp(-since / tau)])
