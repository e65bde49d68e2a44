import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class MovingAverage(TransferEffect):
    """A moving average of length T, as of a decimating filter: linear phase."""

    equation = "sinc(fT)·exp(−jπfT)"
    source = "boxcar filter; −3 dB at 0.443/T, delay T/2"
    breaker = "points up to the first null at 1/T"
    in_every_device = True

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        top = float(points.frequency.max())
        starts = tuple(share / top for share in (0.1, 0.4, 0.8, 1.3, 1.8, 2.6, 3.6))
        return (Parameter("average_s", "s", 1e-3 / top, 5.0 / top, starts, log=True),)

    def factor(self, points: Conditions, values: Array) -> Complex:
        turn = points.frequency * values[0]
        return np.asarray(np.sinc(turn) * np.exp(-1j * np.pi * turn), dtype=np.complex128)
