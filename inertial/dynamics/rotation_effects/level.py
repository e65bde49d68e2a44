import numpy as np

from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect, of_lab


class Level(RotationEffect):
    """A base of the table that is not level."""

    equation = "Δup in the laboratory's x and y"
    source = "mechanism: levelling"
    unit = "µrad"
    breaker = "a level on the base of the table"
    of_table = True

    def columns(self, at: Nodes) -> Array:
        return np.stack([of_lab(at, (1.0, 0.0, 0.0)), of_lab(at, (0.0, 1.0, 0.0))], axis=-1)
