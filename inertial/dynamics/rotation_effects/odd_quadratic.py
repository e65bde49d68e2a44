import numpy as np

from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class OddQuadratic(RotationEffect):
    """A response that grows with the square of the force and has its sign."""

    equation = "Koq·f·|f|"
    source = "IEEE Std 1293"
    unit = "µg/g²"
    breaker = "a centrifuge, beyond 1 g"

    def columns(self, at: Nodes) -> Array:
        return at.force * np.abs(at.force)
