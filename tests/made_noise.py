"""Records of noise, made from physics and not from the model that the analysis fits. Truth for tests and benchmarks."""

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import oaconvolve

Array = NDArray[np.float64]


def white(rng: Generator, shape: tuple[int, ...], density: float, rate_hz: float) -> Array:
    """White noise (..., n) of one-sided `density` (unit/√Hz, as on a data sheet): a sample has density·√(rate/2)."""
    return rng.normal(scale=density * np.sqrt(0.5 * rate_hz), size=shape)


def flicker(rng: Generator, shape: tuple[int, ...], instability: float) -> Array:
    """Noise (..., n) of two-sided spectrum B²/(2πf), B = `instability` in the unit of the output.

    Fractional integration of order 1/2 of white noise, whose impulse response is h[k] = h[k-1]·(k - 1/2)/k: N. J. Kasdin,
    Proc. IEEE 83 (1995) 802, eq. 104. Starts at rest: no wander before the first sample.
    """
    n = shape[-1]
    steps = np.arange(1, n, dtype=np.float64)
    response = np.concatenate([[1.0], np.cumprod((steps - 0.5) / steps)])
    drive = rng.normal(scale=instability, size=shape)
    return np.asarray(oaconvolve(drive, response.reshape((1,) * (len(shape) - 1) + (n,)), axes=-1))[..., :n]


def random_walk(rng: Generator, shape: tuple[int, ...], coefficient: float, rate_hz: float) -> Array:
    """Random walk (..., n) of `coefficient` K (unit/√s), starting at zero."""
    return np.cumsum(rng.normal(scale=coefficient / np.sqrt(rate_hz), size=shape), axis=-1)


def quantisation(rng: Generator, shape: tuple[int, ...], coefficient: float, rate_hz: float) -> Array:
    """Output (..., n) of an integrating converter whose velocity counts have a step q = Q·√12 (unit·s), Q = `coefficient`.

    The rounding error of the count is uniform; the output is its difference times the rate.
    """
    step = coefficient * np.sqrt(12.0)
    error = rng.uniform(-0.5 * step, 0.5 * step, size=(*shape[:-1], shape[-1] + 1))
    return np.diff(error, axis=-1) * rate_hz
