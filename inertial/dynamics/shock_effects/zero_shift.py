import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect


class ZeroShift(ShockEffect):
    """A zero of the unit that shifts with the pulse and stays, with one sign for shocks of both directions."""

    equation = "z·∫|r|dt, of its final value"
    source = "mechanism: change of stress in the sensing element or its mounting"
    unit = "g"
    breaker = "shocks in the other direction, and a longer record after the pulse: the shift stays"

    def added(self, wave: Array, rate_hz: float) -> Array:
        passed = np.cumsum(np.abs(wave))
        return np.asarray(passed / passed[-1])
