"""Refusal of orders beyond an exciter's displacement, velocity or acceleration, and of references that cannot be right."""

import numpy as np
from numpy.typing import NDArray

from schemas.errors import OperatorNeeded
from schemas.motion import Motion
from schemas.profile import Profile
from schemas.vibration_profile import load_vibration_profile
from stations.devices.recording import RecordingSpoilt

Array = NDArray[np.float64]
FLAT_SHARE = (
    5e-4  # of the samples of Gaussian vibration within a thousandth of an extreme: a range of 3.3 σ has so many
)
FEWEST_FLAT = 20
FLAT_SHARE_OF_SINE = 0.1  # of the samples of a sine: it has less


def refuse_motion(profile: Profile, name: str, frequency: float, level_g: float) -> None:
    """Refuse a sine that exceeds the exciter's motion; :class:`OperatorNeeded`, since repeating it changes nothing."""
    _refuse((profile.motion or Motion()).beyond_sine(frequency, level_g), f"{name}: {level_g:g} g at {frequency:g} Hz")


def refuse_random_motion(profile: Profile, name: str, vibration: str, level_g: float) -> None:
    """Refuse a random profile whose three-sigma peaks exceed the exciter's motion; :class:`OperatorNeeded`."""
    points = load_vibration_profile(vibration).breakpoints
    _refuse((profile.motion or Motion()).beyond_random(points, level_g), f"{name}: {vibration} at {level_g:g} g rms")


def refuse_clipped_random(driven: Array, name: str) -> None:
    """Refuse Gaussian vibration (n,) whose extremes are flat: the conditioner of the reference clips."""
    refuse_flat(np.abs(driven - driven.mean()), name, max(FEWEST_FLAT, FLAT_SHARE * driven.size))


def refuse_flat(size: Array, name: str, most: float, near: float = 0.999) -> None:
    """Refuse a reference that lies near its largest size (n,) in more than ``most`` samples: its conditioner clips."""
    top = float(size.max())
    if int(np.count_nonzero(size > near * top)) > most:
        raise RecordingSpoilt(
            f"{name}: the reference is clipped at {top:.4g} g; choose a larger range of its conditioner"
        )


def tone_level(driven: Array, rate_hz: float, frequency: float) -> tuple[float, float]:
    """Peak value of the tone in a record (n,), and the standard deviation of what is left beside it and its offset."""
    phase = 2.0 * np.pi * frequency * np.arange(driven.size) / rate_hz
    rows = np.column_stack([np.cos(phase), np.sin(phase), np.ones_like(phase)])
    c = np.linalg.lstsq(rows, driven, rcond=None)[0]
    return float(np.hypot(c[0], c[1])), float(np.std(driven - rows @ c))


def _refuse(why: str, what: str) -> None:
    if why:
        raise OperatorNeeded(f"{what}: {why}; lower the level, or correct maximum of the exciter in the station's file")
