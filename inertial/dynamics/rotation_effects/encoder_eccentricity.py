from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect, about, waves


class EncoderEccentricity(RotationEffect):
    """An encoder disc off its centre: the angle is wrong by one wave a turn."""

    equation = "ε·cos(θ + φ)·df/dθ"
    source = "mechanism: eccentric disc"
    unit = "µrad"
    breaker = "the table calibrated against an autocollimator; the device turned on its seat"
    of_table = True

    def columns(self, at: Nodes) -> Array:
        return about(at, waves(at, 1))
