"""Drift filter on x = [a, b]: specific force and bias from an output, with the noise that the Allan analysis found."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inertial.noise.terms import NoiseTerms

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drift:
    """Noise of a corrected output, in g: white noise and a bias that obeys db/dt = -b/tau + w."""

    white: Array
    """(...,) N of IEEE 952, g/√Hz (two-sided): a sample has N·√rate."""
    instability: Array
    """(...,) standard deviation of the bias when it has a correlation time; not used where `walk` is not zero."""
    walk: Array
    """(...,) K of a bias that walks freely, g/√s; zero for a bias with a correlation time."""
    correlation_s: float
    """tau, s."""

    @property
    def rate_density(self) -> Array:
        """Two-sided density of w (...,), g²/s: K² for a walk, 2·B²/tau for a correlated bias."""
        return np.where(self.walk > 0.0, self.walk**2, 2.0 * self.instability**2 / self.correlation_s)


def drift_from_terms(terms: NoiseTerms, correlation_s: float) -> Drift:
    """Noise of the filter from fitted Allan terms in g: N, and K or, where K is not identified, B with `correlation_s`.

    A coefficient that is not identified enters with its upper limit: the filter then trusts its bias too little, not too
    much.
    """
    place = {symbol: k for k, symbol in enumerate(terms.symbols)}
    known = np.where(np.isnan(terms.value), terms.high, terms.value)
    walk = np.where(np.isnan(terms.value[..., place["K"]]), 0.0, terms.value[..., place["K"]])
    return Drift(known[..., place["N"]], known[..., place["B"]], walk, correlation_s)


@dataclass
class DriftFilter:
    """Kalman filter of any number of channels at once, one step per sample.

    Specific force and bias add in the output, so nothing but a known force tells them apart: at rest on the ground, or
    in a known pose, `step` takes it as `reference`; in between the bias only drifts and its uncertainty grows.

    Parameters
    ----------
    drift : noise of the channels
    rate_hz : Hz; 100 to 200 for MEMS
    agility : (...,), g/√s; how fast specific force changes, as a random walk
    reference_sd : standard deviation of a reference force, g
    """

    drift: Drift
    rate_hz: float
    agility: float = 1.0
    reference_sd: float = 1e-6
    _x: Array = field(init=False, repr=False)
    _p: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        shape = np.shape(self.drift.white)
        self._x = np.zeros((*shape, 2))
        self._p = np.zeros((*shape, 2, 2))
        self._p[..., 0, 0] = 4.0
        self._p[..., 1, 1] = np.maximum(self.drift.instability**2, self.drift.walk**2 * self.drift.correlation_s)

    @property
    def force(self) -> Array:
        """Specific force (...,), g."""
        return self._x[..., 0].copy()

    @property
    def bias(self) -> Array:
        """Bias (...,), g."""
        return self._x[..., 1].copy()

    @property
    def bias_sd(self) -> Array:
        """Standard deviation of the bias (...,), g."""
        return np.sqrt(self._p[..., 1, 1])

    def step(self, output: ArrayLike, reference: ArrayLike | None = None) -> Array:
        """Specific force (...,) in g after one more sample.

        Parameters
        ----------
        output : (...,), g, after K⁻¹ of the calibration
        reference : (...,), g; the true force where it is known, NaN where not
        """
        self._predict()
        self._update(np.ones(2), np.asarray(output, dtype=np.float64), self.drift.white**2 * self.rate_hz)
        if reference is not None:
            self._update(
                np.array([1.0, 0.0]), np.asarray(reference, dtype=np.float64), np.asarray(self.reference_sd**2)
            )
        return self.force

    def _predict(self) -> None:
        step = 1.0 / self.rate_hz
        keep = np.where(self.drift.walk > 0.0, 1.0, np.exp(-step / self.drift.correlation_s))
        grown = np.where(
            self.drift.walk > 0.0, self.drift.rate_density * step, self.drift.instability**2 * (1.0 - keep**2)
        )
        self._x[..., 1] *= keep
        self._p[..., 0, 1] *= keep
        self._p[..., 1, 0] *= keep
        self._p[..., 1, 1] = self._p[..., 1, 1] * keep**2 + grown
        self._p[..., 0, 0] += self.agility**2 * step

    def _update(self, row: Array, measured: Array, variance: Array) -> None:
        """Measurement update with Joseph's form, which keeps the covariance symmetric and positive."""
        known = np.isfinite(measured)
        innovation = np.where(known, measured, 0.0) - self._x @ row
        across = self._p @ row
        gain = across / (across @ row + variance)[..., None] * known[..., None]
        self._x = self._x + gain * innovation[..., None]
        left = np.eye(2) - gain[..., :, None] * row
        noise = gain[..., :, None] * gain[..., None, :] * np.asarray(variance)[..., None, None]
        self._p = left @ self._p @ np.swapaxes(left, -1, -2) + noise
