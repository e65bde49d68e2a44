import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class Amplitude(TransferEffect):
    """A sensitivity that depends on the amplitude: cubic nonlinearity seen by a sine."""

    equation = "1 + ¾·K3·a²"
    source = "describing function of K3·a³ for a sine of peak a"
    breaker = "one frequency at several levels"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        top = float(points.level.max())
        return (Parameter("cubic_share_g2", "1/g²", -0.5 / top**2, 0.5 / top**2, (0.0,)),)

    def factor(self, points: Conditions, values: Array) -> Complex:
        return np.asarray(1.0 + 0.75 * values[0] * points.level**2, dtype=np.complex128)

    def seen(self, points: Conditions) -> bool:
        """Whether the levels differ by a fifth or more."""
        return bool(np.ptp(points.level) > 0.2 * float(points.level.max()))
