import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class MountingResonance(TransferEffect):
    """A resonance of the mounting between the reference and the device."""

    equation = "(1 + 2jζr)/(1 − r² + 2jζr), r = f/f_m"
    source = "transmissibility of a base-excited mass; ISO 5348"
    breaker = "another torque, adhesive or fixture"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        top = float(points.frequency.max())
        starts = tuple(float(top * share) for share in (*np.geomspace(0.15, 1.0, 12), 2.0, 5.0))
        return (
            Parameter("mount_hz", "Hz", 0.05 * top, 20.0 * top, starts, log=True),
            Parameter("mount_damping", "1", 2e-3, 0.5, (0.03,), log=True),
        )

    def factor(self, points: Conditions, values: Array) -> Complex:
        ratio = points.frequency / values[0]
        damped = 2j * values[1] * ratio
        return np.asarray((1.0 + damped) / (1.0 - ratio**2 + damped), dtype=np.complex128)
