from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect, elapsed


class ScaleDrift(RotationEffect):
    """A scale that drifts during the test."""

    equation = "s·t·f"
    source = "mechanism: temperature during the test"
    unit = "ppm over the test"
    breaker = "the planes in another order"

    def columns(self, at: Nodes) -> Array:
        return elapsed(at)[:, None] * at.force
