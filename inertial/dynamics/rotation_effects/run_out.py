from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect, leaning


class RunOut(RotationEffect):
    """An axis that leans in its bearing as it turns, twice a turn."""

    equation = "w·cos(2θ + φ) along the standing axis"
    source = "mechanism: oval races, balls of unequal size"
    unit = "µrad"
    breaker = "the run-out measured by a gauge or an electronic level"
    of_table = True

    def columns(self, at: Nodes) -> Array:
        return leaning(at, 2)
