"""Base class of the effects on a shock comparison."""

from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from scipy.signal import cont2discrete, lfilter

from inertial.arrays import Array
from inertial.dynamics.effect_modules import DynamicEffect
from inertial.dynamics.transfer_effects.base import Parameter


class ShockEffect(DynamicEffect):
    """How the unit's waveform departs from that of the reference. Every module of this package defines one class.

    A waveform effect changes the reference's waveform; an added effect adds a waveform with a linear coefficient.

    unit : of the coefficient, or of the first parameter
    """

    unit: ClassVar[str]

    def parameters(self, duration_s: float) -> tuple[Parameter, ...]:
        """The nonlinear parameters, with bounds and starts that suit a pulse; none for an added effect."""
        return ()

    def changed(self, wave: Array, rate_hz: float, values: Array) -> Array:
        """The waveform (n,) with the effect."""
        return wave

    def added(self, wave: Array, rate_hz: float) -> Array | None:
        """The waveform (n,) that is added with a coefficient of its own; None for an effect on the waveform."""
        return None


def corner(name: str, duration_s: float) -> Parameter:
    """Corner of a filter, Hz, from half to fifty times the inverse of the duration of the pulse."""
    starts = (1.5 / duration_s, 5.0 / duration_s)
    return Parameter(name, "Hz", 0.5 / duration_s, 50.0 / duration_s, starts, log=True)


def through(wave: Array, rate_hz: float, numerator: list[float], denominator: list[float]) -> Array:
    """A waveform (n,) that begins at zero, filtered by a transfer function in s; exact for linear interpolation."""
    return np.asarray(lfilter(*_discrete(tuple(numerator), tuple(denominator), rate_hz), wave), dtype=np.float64)


@lru_cache(maxsize=64)
def _discrete(numerator: tuple[float, ...], denominator: tuple[float, ...], rate_hz: float) -> tuple[Array, Array]:
    """Coefficients of the digital filter of a transfer function in s: the shocks of a record are filtered in turn."""
    system: Any = cont2discrete((numerator, denominator), 1.0 / rate_hz, method="foh")
    return np.atleast_1d(np.squeeze(system[0])), np.asarray(system[1])
