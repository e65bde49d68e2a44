from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class SecondOrder(RotationEffect):
    """A response of second order along each axis."""

    equation = "K2·f²"
    source = "IEEE Std 1293"
    unit = "µg/g²"
    breaker = "the device the other way round, or a centrifuge"

    def columns(self, at: Nodes) -> Array:
        return at.force**2
