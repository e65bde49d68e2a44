from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class ThirdOrder(RotationEffect):
    """A response of third order along each axis."""

    equation = "K3·f³"
    source = "IEEE Std 1293"
    unit = "µg/g³"
    breaker = "a centrifuge, beyond 1 g"

    def columns(self, at: Nodes) -> Array:
        return at.force**3
