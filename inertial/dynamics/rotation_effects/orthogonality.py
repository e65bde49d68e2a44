from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect, between_axes


class Orthogonality(RotationEffect):
    """Axes of the table that are not at right angles."""

    equation = "γ between outer and inner axis"
    source = "mechanism: machining of the table"
    unit = "µrad"
    breaker = "a square on the table; the plane xz besides the others"
    of_table = True

    def columns(self, at: Nodes) -> Array:
        return between_axes(at)[..., None]
