from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class SecondOrder(CentrifugeEffect):
    """A quadratic nonlinearity of the sensing element."""

    equation = "K2·a²"
    source = "IEEE Std 1293, K2"
    unit = "g/g²"
    breaker = "points at more accelerations, in both mountings"

    def column(self, points: Spins) -> Array:
        return points.acceleration**2
