from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class BiasDrift(CentrifugeEffect):
    """A bias that drifts during the test."""

    equation = "d·t"
    source = "mechanism: temperature or ageing during the test"
    unit = "g over the test"
    breaker = "bias before and after at rest; the speeds in another order"

    def column(self, points: Spins) -> Array:
        return points.order - 0.5
