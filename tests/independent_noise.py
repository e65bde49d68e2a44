"""Noise for judging estimators, made without any of their code: by Fourier synthesis, and by sums in time.

`tests.made_noise` filters white noise (Kasdin), the plant and the covariances add Ornstein–Uhlenbeck processes. Here 1/f
noise is drawn frequency by frequency, so that neither a filter nor a set of time constants is shared with what is judged.
"""

import numpy as np
from scipy.stats import binomtest

Array = np.ndarray


def share(count: int, total: int) -> tuple[float, float, float]:
    """Share of a count with the exact 95 % interval (Clopper and Pearson 1934)."""
    interval = binomtest(count, total).proportion_ci(0.95, "exact")
    return count / total, float(interval.low), float(interval.high)


def told(name: str, count: int, total: int) -> str:
    """A share as the closing notes print it."""
    middle, low, high = share(count, total)
    return f"{name:<64} {count:>6}/{total:<6} {100 * middle:6.2f} % [{100 * low:.2f}, {100 * high:.2f}]"


def white(rng: np.random.Generator, rows: int, n: int, density: float, rate: float) -> Array:
    """White noise (rows, n) of a one-sided density, unit/√Hz."""
    return density * np.sqrt(rate / 2.0) * rng.standard_normal((rows, n))


def flicker(rng: np.random.Generator, rows: int, n: int, instability: float, *, longer: int = 8) -> Array:
    """1/f noise (rows, n) of the one-sided density B²/(π·f), whatever the rate: spectral lines down to 1/(longer·n).

    A line of the one-sided density S in a period of N samples at unit rate has E|X|² = N·S/2.
    """
    size = 2 ** int(np.ceil(np.log2(longer * n)))
    frequency = np.arange(1, size // 2 + 1) / size
    height = np.sqrt(0.5 * size * instability**2 / (np.pi * frequency))
    lines = np.zeros((rows, size // 2 + 1), dtype=complex)
    lines[:, 1:] = height * (rng.standard_normal((rows, height.size)) + 1j * rng.standard_normal((rows, height.size)))
    series = np.fft.irfft(lines / np.sqrt(2.0), size, axis=1)
    start = int(rng.integers(0, size - n + 1))
    return series[:, start : start + n]


def walk(rng: np.random.Generator, rows: int, n: int, coefficient: float, rate: float) -> Array:
    """Random walk (rows, n) of K, unit/√s."""
    return np.cumsum(coefficient / np.sqrt(rate) * rng.standard_normal((rows, n)), axis=1)


def autoregressive(rng: np.random.Generator, rows: int, n: int, memory: float, *, dof: float | None = None) -> Array:
    """Series (rows, n) of variance one with the correlation ``memory`` between neighbours; Student's innovations if ``dof``."""
    burn = 200
    drive = rng.standard_normal((rows, n + burn))
    if dof is not None:
        drive = rng.standard_t(dof, (rows, n + burn)) * np.sqrt((dof - 2.0) / dof)
    out = np.empty_like(drive)
    last = np.zeros(rows)
    for k in range(n + burn):
        last = memory * last + np.sqrt(1.0 - memory**2) * drive[:, k]
        out[:, k] = last
    return out[:, burn:]


def dwell_means(record: Array, start: Array, seconds: int) -> Array:
    """Means (rows, dwells) over ``seconds`` from ``start`` (dwells,), whole seconds, of a record (rows, n) at 1 Hz."""
    sums = np.concatenate([np.zeros((len(record), 1)), np.cumsum(record, axis=1)], axis=1)
    return (sums[:, start + seconds] - sums[:, start]) / seconds
