"""Covariance of dwell means: white noise and a 1/f wander between the dwells, in real time.

The wander is a sum of Ornstein–Uhlenbeck processes of equal variance with time constants an octave apart: its spectrum is 1/f
between the slowest and the fastest. In the basis that diagonalises it against the white part every covariance
a·(I + ρ·F) is diagonal, so that trying many values of ρ costs nothing.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.noise.flicker import flicker_kernel

Array = NDArray[np.float64]

LONGEST = 1500
"""Dwells beyond which the wander is left out: its covariance would not fit. Long runs are averaged before they are judged."""

_EVEN = 1.3
"""White standard errors of a block that differ by less than this factor are taken as equal: one basis then serves a whole lot."""


@dataclass(frozen=True)
class Basis:
    """Rotation in which white noise is the identity and the wander is diagonal.

    turn : (1 or blocks, n, n), applied from the left to values already divided by ``error``; None leaves them (long records)
    error : (blocks, n), white standard error of each dwell, g; infinite for a dwell that is not there
    wander : (1 or blocks, n), variance of the wander along each rotated coordinate, for share ρ = 1
    count : number of dwells that are there
    """

    turn: Array | None
    error: Array
    wander: Array
    count: int

    def rotate(self, columns: Array) -> Array:
        """Columns (blocks, n, m) divided by the white standard error and rotated."""
        weighted = columns / self.error[..., None]
        return weighted if self.turn is None else np.matmul(self.turn, weighted)

    @cached_property
    def white(self) -> float:
        """Mean variance of the white noise of the dwells that are there, g²."""
        return float(np.mean(self.error[np.isfinite(self.error)] ** 2))

    @cached_property
    def wander_about_mean(self) -> float:
        """Mean variance of the wander about the record's own mean, for share ρ = 1."""
        if self.turn is None:
            return 0.0
        return float(_about_mean((self.turn[0].T * self.wander[0]) @ self.turn[0]))

    def spread(self, share: float) -> Array:
        """Standard deviations (1 or blocks, n) of the rotated coordinates at a share ρ of wander, for white noise of 1."""
        return np.sqrt(1.0 + share * self.wander)


def steep_kernel(time: Array) -> Array:
    """Covariance of 1/f wander and a random walk of the same variance about the record's mean, (..., n, n)."""
    start = time.min(axis=-1, keepdims=True)
    since = (time - start) / max(float(np.ptp(time)), 1.0)
    walk = np.minimum(since[..., :, None], since[..., None, :])
    return (
        flicker_kernel(time)
        + walk * (_about_mean(flicker_kernel(time)) / np.maximum(_about_mean(walk), 1e-12))[..., None, None]
    )


def _about_mean(kernel: Array) -> Array:
    """Mean variance about the record's mean, (...,)."""
    n = kernel.shape[-1]
    return np.trace(kernel, axis1=-2, axis2=-1) / n - kernel.sum(axis=(-2, -1)) / n**2


def basis(time: Array, error: Array, *, steep: bool = False) -> Basis:
    """The rotation for blocks of dwells.

    Parameters
    ----------
    steep : whether the wander has a random walk in it
    time : (blocks, n), s
    error : (blocks, n), white standard error of each dwell, infinite where a dwell is missing
    """
    there = np.isfinite(error)
    if time.shape[-1] > LONGEST:
        return Basis(None, error, np.zeros((1, time.shape[-1])), int(there.sum()))
    even = _evened(error, there)
    kernel = steep_kernel if steep else flicker_kernel
    same_time = np.all(np.abs(time - time[:1]) < 1.0)
    flat = np.all(there) and np.all(even == even[:, :1])
    if same_time and flat:
        values, vectors = np.linalg.eigh(kernel(time[0]))
        turn, wander = vectors.T[None], np.maximum(values, 0.0)[None]
    else:
        typical = np.array([np.mean(e[t] ** 2) if t.any() else 1.0 for e, t in zip(even, there, strict=True)])
        weight = np.where(there, np.sqrt(typical)[:, None] / even, 0.0)
        values, vectors = np.linalg.eigh(kernel(time) * weight[:, :, None] * weight[:, None, :])
        turn, wander = np.swapaxes(vectors, -1, -2), np.maximum(values, 0.0)
    return Basis(turn, even, wander, int(there.sum()))


def _evened(error: Array, there: NDArray[np.bool_]) -> Array:
    """Standard errors, made equal within a block where they nearly are."""
    out = error.copy()
    for block, mask in enumerate(there):
        values = error[block, mask]
        if values.size and values.max() < _EVEN * values.min():
            out[block, mask] = np.sqrt(np.mean(values**2))
    return out
