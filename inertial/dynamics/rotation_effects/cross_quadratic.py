import numpy as np

from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class CrossQuadratic(RotationEffect):
    """A response to the product of the forces along an axis and the next one."""

    equation = "Kip·f·f₊₁"
    source = "mechanism: a pendulous mass that load turns towards the next axis; IEEE Std 1293"
    unit = "µg/g²"
    breaker = "the plane of both axes at other angles, or a centrifuge"

    def columns(self, at: Nodes) -> Array:
        return at.force * np.roll(at.force, -1, axis=-1)
