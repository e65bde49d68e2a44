import numpy as np

from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class Asymmetry(RotationEffect):
    """A scale that differs by the sign of the force."""

    equation = "½·K1′·|f|"
    source = "IEEE Std 1293"
    unit = "µg/g"
    breaker = "a centrifuge, in both mountings"

    def columns(self, at: Nodes) -> Array:
        return np.abs(at.force)
