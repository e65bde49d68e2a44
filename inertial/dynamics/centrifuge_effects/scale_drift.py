from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class ScaleDrift(CentrifugeEffect):
    """A sensitivity that drifts during the test, as by the heat of windage."""

    equation = "s·t·a"
    source = "mechanism: windage heats the units"
    unit = "g/g over the test"
    breaker = "the temperature of the unit logged; the speeds in another order"

    def column(self, points: Spins) -> Array:
        return (points.order - 0.5) * points.acceleration
