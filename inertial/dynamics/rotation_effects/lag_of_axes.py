from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class LagOfAxes(RotationEffect):
    """Outputs of a device that are late, each by a time of its own."""

    equation = "−τ·df/dt"
    source = "mechanism: output filter, thermal or viscous lag of the element"
    unit = "ms"
    breaker = "the same turn at another rate: a lag in time grows with it, hysteresis does not"
    factor = 1e3

    def columns(self, at: Nodes) -> Array:
        return -at.points.rate[:, None] * at.slope
