import numpy as np

from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class RateGain(RotationEffect):
    """A gain that changes with the rate of the turn: by the square of the frequency, as the gain of a low pass begins to."""

    equation = "g·(ω/ω_max)²·f, ω_max of the fastest turn"
    source = "mechanism: output filter, damping of the element"
    unit = "ppm at the fastest turn"
    breaker = "the same turn at another rate, or a sweep"

    def columns(self, at: Nodes) -> Array:
        rate = np.abs(at.points.rate)
        return ((rate / rate.max()) ** 2)[:, None] * at.force
