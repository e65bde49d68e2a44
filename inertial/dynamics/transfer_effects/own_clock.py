import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class OwnClock(TransferEffect):
    """A clock of the device that departs from the reference, where the fit was made at the given frequency."""

    equation = "sinc(ε·f·T)"
    source = "sine fit at a wrong frequency, IEEE Std 1057"
    breaker = "fit the frequency too, or share a clock or sync edge"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        top = float(np.max(points.frequency * points.record_s))
        return (Parameter("clock_share", "1", 1e-3 / top, 0.95 / top, (0.1 / top, 0.4 / top), log=True),)

    def factor(self, points: Conditions, values: Array) -> Complex:
        return np.asarray(np.sinc(values[0] * points.frequency * points.record_s), dtype=np.complex128)

    def seen(self, points: Conditions) -> bool:
        """Whether the durations of the records are known."""
        return bool(np.all(np.isfinite(points.record_s)))
