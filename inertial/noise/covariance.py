"""Sampling covariance of overlapping Allan variances under a mixture of noises.

The phase x (running integral of the output) of each noise has a generalised autocovariance s(t); the second differences
z(m) of x at a spacing of m samples are stationary and Gaussian, and the estimate is their mean square over 2 tau^2. Hence
Cov[z1^2, z2^2] = 2 Cov[z1, z2]^2, summed over all pairs of a record: the method of C. Greenhall and W. Riley,
"Uncertainty of stability variances based on finite differences", PTTI 2003, here for a sum of noises instead of one
power law. The squares of a sum of noises are a quadratic form of their strengths, so the sums are formed once per
record length and reused for every channel and iteration.

Units: time in samples, so that a strength of 1 means tau = m. The functions of `terms` bring the rate in.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from inertial.arrays import Array, Index

NOISES = ("Q", "N", "B", "K")
"""Terms that are random; the ramp R is deterministic and enters as the mean of z."""

_STENCIL = np.array([1.0, -2.0, 1.0])
_POINTS_PER_SPACING = 16
_GROWTH = 1.08
_REACH = 4.0
"""Lags are summed to this multiple of m1 + m2: only flicker reaches past 1, and its square falls as the fourth power."""


def autocovariance(lag: Array) -> Array:
    """Generalised autocovariances of the phase of N, B and K of unit strength at `lag`, all but quantisation.

    White: -|t|/2. Flicker: t^2 ln|t| / (2 pi). Random walk: |t|^3 / 12. Each reproduces its Allan variance of IEEE Std
    952 (N^2/tau, B^2 2 ln2/pi, K^2 tau/3), which a test states. Terms that a second difference removes are left out.

    Parameters
    ----------
    lag : (...), samples

    Returns
    -------
    (3, ...)
    """
    t = np.abs(lag)
    log = np.log(np.where(t > 0.0, t, 1.0))
    return np.stack([-0.5 * t, t * t * log / (2.0 * np.pi), t**3 / 12.0])


@dataclass(frozen=True)
class Sums:
    """Moments of the Allan variances of one record length: everything but the strengths of the noises."""

    m: Index
    """(t,) spacings, samples."""
    quadratic: Array
    """(t, t, 4, 4): Cov[v1, v2] is the quadratic form of the strengths of `NOISES`."""
    ramp: Array
    """(t, t, 4): Cov[v1, v2] per strength and per squared ramp."""

    def averaged(self, records: int) -> "Sums":
        """The moments of the mean of the variances of independent records of this length."""
        return replace(self, quadratic=self.quadratic / records, ramp=self.ramp / records)

    def covariance(self, strengths: Array, ramp: Array) -> Array:
        """Covariance of the Allan variances: strengths (..., 4) of `NOISES`, ramp (...) squared → (..., t, t)."""
        size = self.quadratic.shape[:2]
        pairs = (strengths[..., :, None] * strengths[..., None, :]).reshape(*strengths.shape[:-1], -1)
        noise = pairs @ self.quadratic.reshape(-1, pairs.shape[-1]).T
        drift = strengths @ self.ramp.reshape(-1, strengths.shape[-1]).T
        return (noise + ramp[..., None] * drift).reshape(*strengths.shape[:-1], *size)


@lru_cache(maxsize=16)
def sums(n: int, spacings: tuple[int, ...]) -> Sums:
    """Moments of the estimates of a record of `n` samples at `spacings` (samples)."""
    size = len(spacings)
    quadratic = np.zeros((size, size, 4, 4))
    ramp = np.zeros((size, size, 4))
    for a, small in enumerate(spacings):
        for b in range(a, size):
            square, linear = _pair(n, small, spacings[b])
            quadratic[a, b] = quadratic[b, a] = square
            ramp[a, b] = ramp[b, a] = linear
    return Sums(m=np.asarray(spacings, dtype=np.int64), quadratic=quadratic, ramp=ramp)


def _pair(n: int, m1: int, m2: int) -> tuple[Array, Array]:
    """Quadratic form (4, 4) and ramp vector (4,) of Cov[v(m1), v(m2)], m1 <= m2."""
    count1, count2 = n + 1 - 2 * m1, n + 1 - 2 * m2
    lags = _lags(m1, m2, (-(count1 - 1), count2 - 1))
    gaps = np.diff(lags)
    widths = 0.5 * (np.concatenate([[1.0], gaps]) + np.concatenate([gaps, [1.0]]))  # lags that each stands for
    weights = _pairs_at(lags, count1, count2) * widths
    smooth = np.concatenate([np.zeros((1, lags.size)), _cross(lags, m1, m2)])
    form = np.einsum("cl,dl,l->cd", smooth, smooth, weights)
    line = smooth @ weights
    _add_quantisation(form, line, m1, m2, (count1, count2))
    scale = 1.0 / (float(m1) ** 2 * float(m2) ** 2 * count1 * count2)
    # Cov[z1^2, z2^2] = 2 R^2 + 4 mu1 mu2 R with mu = R_ramp m^2; each variance carries 1 / (2 m^2)
    return 0.5 * scale * form, scale * float(m1) ** 2 * float(m2) ** 2 * line


def _lags(m1: int, m2: int, ends: tuple[int, int]) -> Array:
    """Whole lags (l,) at which the covariance of z1 and z2 is taken: dense where it has kinks, sparse in between.

    The three points of z2 make kinks as wide as z1; away from them the covariance is smooth on the scale of the distance.
    """
    near = np.arange(0.0, 4.0 * m1, max(1.0, m1 / _POINTS_PER_SPACING))
    reach = _REACH * (m1 + m2)
    far = np.geomspace(4.0 * m1, 4.0 * m1 + reach, 2 + int(np.log(1.0 + reach / (4.0 * m1)) / np.log(_GROWTH)))
    offsets = np.concatenate([-far, -near, near, far])
    lags = np.rint(np.concatenate([m1 - j * m2 + offsets for j in range(3)]))
    return np.unique(np.clip(lags, *ends))


def _cross(lags: Array, m1: int, m2: int) -> Array:
    """Covariance (3, lags) of the second differences at spacings m1 and m2, per unit strength of N, B, K."""
    total = np.zeros((3, lags.size))
    for i, ci in enumerate(_STENCIL):
        for j, cj in enumerate(_STENCIL):
            total += ci * cj * autocovariance(lags + float(j * m2 - i * m1))
    return total


def _pairs_at(lags: Array, count1: int, count2: int) -> Array:
    """How many pairs (k, k + lag) both records of second differences hold."""
    return np.maximum(np.minimum(count1, count2 - lags) - np.maximum(0.0, -lags), 0.0)


def _add_quantisation(form: Array, line: Array, m1: int, m2: int, counts: tuple[int, int]) -> None:
    """Adds the white phase noise: it is a set of spikes, which a strided sum over lags would miss."""
    spikes: dict[int, float] = {}
    for i, ci in enumerate(_STENCIL):
        for j, cj in enumerate(_STENCIL):
            at = i * m1 - j * m2
            spikes[at] = spikes.get(at, 0.0) + float(ci * cj)
    lags = np.array(list(spikes), dtype=np.float64)
    height = np.array(list(spikes.values()))
    weights = _pairs_at(lags, *counts)
    smooth = _cross(lags, m1, m2)
    form[0, 0] = float(np.sum(weights * height**2))
    form[0, 1:] = form[1:, 0] = smooth @ (weights * height)
    line[0] = float(np.sum(weights * height))
