import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class SecondMode(TransferEffect):
    """A second mode: a resonance of fixture or case that adds to the motion of the sensing element."""

    equation = "1 + a·r²/(1 − r² + 2jζr), r = f/f_2"
    source = "modal superposition; ISO 7626-1"
    breaker = "turn the unit about its axis, or move it on the fixture"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        top = float(points.frequency.max())
        starts = tuple(
            float(top * share) for share in np.geomspace(0.1, 0.98, 40)
        )  # apart by twice the width of a mode
        return (
            Parameter("mode_hz", "Hz", 0.05 * top, 2.0 * top, starts, log=True),
            Parameter("mode_damping", "1", 2e-3, 0.3, (0.03,), log=True),
            Parameter("mode_share", "1", -0.5, 0.5, (0.01,)),
        )

    def factor(self, points: Conditions, values: Array) -> Complex:
        ratio = points.frequency / values[0]
        mode = ratio**2 / (1.0 - ratio**2 + 2j * values[1] * ratio)
        return np.asarray(1.0 + values[2] * mode, dtype=np.complex128)
