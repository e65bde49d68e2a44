import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.power import running, switched
from inertial.state import State

GOES_ON, BEGINS_AGAIN = 0.0, 1.0


class AgingLog(SensorEffect):
    """Bias that drifts with the logarithm of the time since power-on.

    Where the devices were switched off for a while within a run, it may have gone on without power, or have begun again.
    """

    id = "aging_log"
    symbol = "kl"
    equation = "kl·ln(1 + u/τ)"
    coefficients = ("kl",)
    source = "mechanism: thermally activated relaxation with a spread of barriers"
    typical_ug = (1.0, 1000.0)
    hides_behind = ("warm_up", "aging_linear")
    breaker = "a long stay at constant temperature after power-on"
    same_on_axes = True
    simplicity = 29
    nonlinear = (Nonlinear("tau", "s", 30.0, 36000.0, "log", 8),)

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        """What the time counts from, too, where that makes a difference."""
        if not switched(state):
            return self.nonlinear
        return (*self.nonlinear, Nonlinear("clock", "", GOES_ON, BEGINS_AGAIN, choices=(GOES_ON, BEGINS_AGAIN)))

    def columns(self, state: State, axis: int, *, tau: float, clock: float = GOES_ON, **nonlinear: float) -> Array:
        since = running(state)
        if clock == BEGINS_AGAIN and state.since_power is not None:
            since = state.since_power
        return stack(state, [np.log1p(since / tau)])
