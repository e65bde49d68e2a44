import numpy as np

from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect, elapsed


class BiasDrift(RotationEffect):
    """A bias that drifts during the test."""

    equation = "d·t"
    source = "mechanism: temperature or ageing during the test"
    unit = "µg over the test"
    breaker = "a static record"

    def columns(self, at: Nodes) -> Array:
        return np.broadcast_to(elapsed(at)[:, None], at.force.shape)
