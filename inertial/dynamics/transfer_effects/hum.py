import numpy as np

from inertial.dynamics.transfer_effects.base import Array, Complex, Conditions, Parameter, TransferEffect


class Hum(TransferEffect):
    """Mains hum by a cable or ground loop, on the points within the resolution of its lines."""

    equation = "1 + c/level at 50 or 60 Hz and harmonics"
    source = "additive tone in the record of a point"
    breaker = "move the points away from the mains lines; record with the exciter off"

    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        return (
            Parameter("hum_real_g", "g", -100.0, 100.0, (0.0,)),
            Parameter("hum_imaginary_g", "g", -100.0, 100.0, (0.0,)),
        )

    def factor(self, points: Conditions, values: Array) -> Complex:
        hit = _near_mains(points)
        return np.asarray(1.0 + hit * (values[0] + 1j * values[1]) / points.level, dtype=np.complex128)

    def seen(self, points: Conditions) -> bool:
        """Whether a point lies on a line of the mains."""
        return bool(np.any(_near_mains(points)))


def _near_mains(points: Conditions) -> Array:
    """1 for the points within 1/T of a line at 50 or 60 Hz; harmonics fall off and are left out."""
    record = np.where(np.isfinite(points.record_s), points.record_s, 1.0)
    away = np.min([np.abs(points.frequency - mains) for mains in (50.0, 60.0)], axis=0)
    return np.asarray(away * record < 1.0, dtype=np.float64)
