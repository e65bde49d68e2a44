from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect, about, waves


class EncoderSecondHarmonic(RotationEffect):
    """An encoder whose angle is wrong by two waves a turn."""

    equation = "ε₂·cos(2θ + φ)·df/dθ"
    source = "mechanism: two reading heads, a bent disc"
    unit = "µrad"
    breaker = "the table calibrated against an autocollimator; the device turned on its seat"
    of_table = True

    def columns(self, at: Nodes) -> Array:
        return about(at, waves(at, 2))
