import numpy as np

from inertial import frames
from inertial.effects.base import Array, Nonlinear, StationEffect
from inertial.state import State


class EncoderHarmonic(StationEffect):
    """Encoder error that repeats once or twice a turn: eccentric disc, sagging load."""

    id = "encoder_harmonic"
    symbol = "ε, φ"
    equation = "α + ε·sin(nα + φ), likewise β"
    coefficients = ("harmonic_sin", "harmonic_cos")
    source = "geometry of a two-axis table"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("second_order", "cross_coupling")
    breaker = "angles off the 90° steps: the second harmonic is nothing there"
    simplicity = 42
    nonlinear = (
        Nonlinear("harmonic", "1", 1.0, 2.0, choices=(1.0, 2.0)),
        Nonlinear("inner_axis", "1", 0.0, 1.0, choices=(0.0, 1.0)),
    )

    def force_change(self, state: State, *, harmonic: float, inner_axis: float, **nonlinear: float) -> Array:
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        if inner_axis:
            force, angle = frames.force_from_angles(outer, inner), inner
            # d/dβ of Rz(β)ᵀ·v turns v by −90° about z
            turned = np.stack([force[..., 1], -force[..., 0], np.zeros_like(angle)], axis=-1)
        else:
            turned, angle = frames.to_fixture((0.0, 1.0, 0.0), outer, inner), outer
        phase = harmonic * angle[..., None]
        return np.stack([turned * np.sin(phase), turned * np.cos(phase)], axis=-1)
