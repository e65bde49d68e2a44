import numpy as np

from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class Hysteresis(RotationEffect):
    """An output that lags behind the angle by the same in each direction, whatever the rate."""

    equation = "h·sign(ω)·df/dθ"
    source = "mechanism: play of the element or of its suspension"
    unit = "µg/g"
    breaker = "the same turn at another rate: a lag in time grows with it, hysteresis does not"

    def columns(self, at: Nodes) -> Array:
        return np.sign(at.points.rate)[:, None] * at.slope
