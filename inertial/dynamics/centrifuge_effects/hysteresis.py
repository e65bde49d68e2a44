from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class Hysteresis(CentrifugeEffect):
    """An output that differs between rising and falling speed."""

    equation = "h·a for falling speed"
    source = "mechanism: the sensing element or the arm returns late"
    unit = "g/g"
    breaker = "the same speeds up and down again"

    def column(self, points: Spins) -> Array:
        return points.slowing * points.acceleration
