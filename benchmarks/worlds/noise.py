"""Noise of a device in real time on a grid of one second: white, 1/f by fractional summation, random walk, tails.

This code is independent of the estimator, which models 1/f as a sum of relaxations, and of the blind runs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

GRID_S = 1.0
FAST_S = 400  # shorter than a soak
PAST = 3  # record lengths of 1/f before the record


@dataclass(frozen=True)
class Noise:
    """Noise of the output of a device.

    white : one-sided density, µg/√Hz; flicker : bias instability B, µg; walk : K, µg/√s
    unit_factors, axis_factors : factors on all terms, cyclic over units and axes
    unit_white, unit_slow, axis_slow : factors on the white part by unit; on 1/f and walk by unit and by axis
    tails : degrees of freedom of a t distribution for the white part of the dwells; 0 for normal
    telegraph : jumps between two levels: their distance, µg, the mean time at one, s, and the share of the axes that jump
    hot : K by which white noise and the fast part of 1/f grow by e, about 25 °C; infinite where they do not
    """

    white: float = 25.0
    flicker: float = 30.0
    walk: float = 0.0
    unit_factors: tuple[float, ...] = (1.0,)
    axis_factors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    unit_white: tuple[float, ...] = (1.0,)
    unit_slow: tuple[float, ...] = (1.0,)
    axis_slow: tuple[float, float, float] = (1.0, 1.0, 1.0)
    tails: int = 0
    telegraph: tuple[float, float, float] = (0.0, 1.0, 0.0)
    hot: float = float("inf")

    def factors(self, units: int) -> Floats:
        """Factor on all terms, (units, 3)."""
        own = np.resize(self.unit_factors, units)
        return own[:, None] * np.array(self.axis_factors)


def dwell_noise(
    noise: Noise, start: Floats, duration: Floats, units: int, rng: np.random.Generator, warm: Floats | None = None
) -> Floats:
    """Errors of the dwell means, (units, n, 3), µg, for dwells that start at ``start`` (n,) s, at ``warm`` (n,) °C."""
    white = noise.white / np.sqrt(2.0 * duration)
    shape = (units, len(start), 3)
    drawn = rng.standard_t(noise.tails, shape) / np.sqrt(3.0) if noise.tails else rng.standard_normal(shape)
    errors = drawn * white[:, None] * np.resize(noise.unit_white, units)[:, None, None]
    begin, end = float(start.min()), float((start + duration).max())
    steps = int(np.ceil((end - begin) / GRID_S)) + 2
    slow = np.zeros((3 * units, steps))
    if noise.flicker > 0.0:
        slow += noise.flicker * fractional(rng, 3 * units, steps)
    if noise.walk > 0.0:
        slow += noise.walk * np.sqrt(GRID_S) * np.cumsum(rng.standard_normal((3 * units, steps)), axis=1)
    if noise.telegraph[2] > 0.0:
        slow += _telegraph(noise.telegraph, 3 * units, steps, rng)
    louder = np.ones(len(start)) if warm is None else np.exp((warm - 25.0) / noise.hot)
    errors = errors * louder[:, None]
    whole = np.concatenate([np.zeros((3 * units, 1)), np.cumsum(slow, axis=1)], axis=1)
    first = ((start - begin) / GRID_S).astype(int)
    last = np.maximum(((start + duration - begin) / GRID_S).astype(int), first + 1)
    means = (whole[:, last] - whole[:, first]) / (last - first)
    if np.isfinite(noise.hot):
        # only what is faster than the time constants of a soak: a slow part would jump with the temperature
        early, late = np.maximum(first - FAST_S // 2, 0), np.minimum(last + FAST_S // 2, whole.shape[1] - 1)
        around = (whole[:, late] - whole[:, early]) / (late - early)
        means = around + (means - around) * louder
    slow_factors = np.resize(noise.unit_slow, units)[:, None] * np.array(noise.axis_slow)
    errors = errors + means.reshape(units, 3, -1).transpose(0, 2, 1) * slow_factors[:, None, :]
    return errors * noise.factors(units)[:, None, :]


def _telegraph(kind: tuple[float, float, float], channels: int, steps: int, rng: np.random.Generator) -> Floats:
    """Jumps between two levels about zero, (channels, steps), µg; of some channels only."""
    distance, stay, share = kind
    level = np.zeros((channels, steps))
    for k in np.flatnonzero(rng.random(channels) < share).tolist():
        jumps = np.cumsum(rng.random(steps) < GRID_S / stay) + rng.integers(2)
        level[k] = distance * (jumps % 2 - 0.5)
    return level


def fractional(rng: np.random.Generator, channels: int, steps: int) -> Floats:
    """1/f noise of bias instability one, (channels, steps): fractional summation of white noise of order one half.

    Kasdin, Proc. IEEE 83 (1995) 802, with alpha = 1: innovations of variance B² have the two-sided density B²/(2πf), whose
    Allan variance is B²·2·ln 2/π.
    """
    total = (1 + PAST) * steps
    k = np.arange(1, total)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    size = 1 << int(np.ceil(np.log2(2 * total)))
    drive = rng.standard_normal((channels, total))
    series = np.fft.irfft(np.fft.rfft(drive, size) * np.fft.rfft(response, size), size)[:, :total]
    return series[:, -steps:]
