from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class ThirdOrder(CentrifugeEffect):
    """A cubic nonlinearity of the sensing element."""

    equation = "K3·a³"
    source = "IEEE Std 1293, K3"
    unit = "g/g³"
    breaker = "points at higher accelerations, in both mountings"

    def column(self, points: Spins) -> Array:
        return points.acceleration**3
