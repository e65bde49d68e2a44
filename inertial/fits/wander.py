"""Generalised least squares of a lot: dwell means that carry white noise, and wander between the dwells.

White-noise standard errors sd/√n leave out that a real output wanders from dwell to dwell; fitted with them alone, the
errors of the coefficients come out several times too small. Here the covariance of the dwell means is white + 1/f +
random walk, the strengths estimated by restricted maximum likelihood over all units and axes of the lot, and
coefficients, errors and residuals follow from it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from inertial import design
from inertial.criticism.noise import flicker_kernel
from inertial.design import Values
from inertial.errors import NotIdentified
from inertial.fits.linear import LotFit, fit_lot
from inertial.state import State

Array = NDArray[np.float64]

_STEP = 10.0
_SHARES = (0.0, *(0.1 * _STEP ** np.arange(7)).tolist())
_FINE = 12
_FAR = 12.0
"""Deviance above the lowest at which a pair of shares is out of the question."""
_CHARGE = 4.0
"""Deviance that wander must be worth to be believed."""


@dataclass(frozen=True)
class WanderFit:
    """A fit with the noise that it found."""

    fit: LotFit
    """Coefficients with covariance and chi-square under white noise and wander."""
    white: float
    """Standard deviation of the white part of a dwell mean over the standard error given; 1 if sd/√n is right."""
    flicker_share: float
    """Variance of the 1/f wander over that of the white part."""
    walk_share: float
    """Variance that a random walk gathers over the whole record, over that of the white part."""

    @property
    def flicker(self) -> float:
        """Standard deviation of the 1/f wander, in standard errors of a dwell as given."""
        return self.white * float(np.sqrt(self.flicker_share))

    @property
    def walk(self) -> float:
        """Standard deviation of the random walk at the end of the record, in standard errors of a dwell as given."""
        return self.white * float(np.sqrt(self.walk_share))


def walk_kernel(time: Array) -> Array:
    """Covariance (n, n) of a random walk that is zero at the first and of variance one at the last of times (n,), s."""
    since = time - time.min()
    return np.minimum(since[:, None], since) / max(float(since.max()), 1e-9)


def fit_lot_with_wander(
    effects: Sequence[str], state: State, output: Array, standard_error: Array, *, nonlinear: Values | None = None
) -> WanderFit:
    """Generalised least-squares fit of a model of sensor effects to the dwells of a lot.

    Parameters
    ----------
    effects : ids of the model; of the sensor, none of the station
    state : the dwells, measured at the same times by all units
    output : (..., n, 3), mean output of each dwell, output unit
    standard_error : (..., n, 3), sd/√n, output unit; every one finite and positive

    Raises
    ------
    NotIdentified
        The plan cannot determine a coefficient, or there are too few dwells for the noise.
    """
    if not np.all(np.isfinite(standard_error) & (standard_error > 0.0)):
        raise NotIdentified(
            "wander: a standard error is zero or infinite; give each dwell the resolution of its output"
        )
    plain = fit_lot(effects, state, output, standard_error, nonlinear=nonlinear)
    if plain.shared.size:
        raise NotIdentified(f"wander: {plain.shared_names[0][0]} belongs to the station; fit it with fit_lot")
    sensor, _ = design.split(effects)
    h = design.local_columns(sensor, state, plain.nonlinear)
    z = np.swapaxes(output, -1, -2)
    error = np.swapaxes(np.broadcast_to(standard_error, output.shape), -1, -2)
    level = np.sqrt(np.mean(error**2, axis=-1, keepdims=True))
    profile = np.sqrt(np.mean((error / level) ** 2, axis=tuple(range(error.ndim - 1))))
    time = np.reshape(np.broadcast_to(state.time, error[..., 0, :].shape), (-1, error.shape[-1]))[0]
    # wander slower than the record is, for the record, the bias itself
    lot = _Lot(h, z / level, profile, (flicker_kernel(time, slowest=1.0), walk_kernel(time)))
    shares = lot.best_shares()
    solved = lot.solve(shares)
    inside = np.asarray(np.einsum("...np,...p->...n", h, solved.theta), dtype=np.float64)
    residual = z - inside * level
    found = replace(
        plain,
        coefficients=solved.theta * level,
        covariance=solved.variance * solved.inverse * level[..., None] ** 2,
        residuals=np.swapaxes(residual, -1, -2),
        chi2=solved.squares / solved.variance,
    )
    return WanderFit(found, float(np.sqrt(solved.variance)), *shares)


@dataclass(frozen=True)
class _Solved:
    theta: Array
    inverse: Array
    squares: Array
    variance: float
    deviance: float


class _Lot:
    """Least squares of the lot, with each unit's and axis' values in units of its standard error."""

    def __init__(self, h: Array, z: Array, profile: Array, kernels: tuple[Array, ...]) -> None:
        scale = np.sqrt(np.mean(h**2, axis=-2, keepdims=True))
        self._scale = np.where(scale > 0.0, scale, 1.0)
        self._h, self._z, self._kernels = h / self._scale, z, kernels
        self._white = np.diag(profile**2)

    def solve(self, shares: Sequence[float]) -> _Solved:
        """Coefficients, their unscaled covariance and the restricted deviance at shares of the kernels."""
        covariance = self._white + sum(share * kernel for share, kernel in zip(shares, self._kernels, strict=True))
        root = np.linalg.cholesky(covariance)
        whiten = solve_triangular(root, np.eye(len(root)), lower=True)
        h, z = np.matmul(whiten, self._h), np.matmul(self._z, whiten.T)
        gram = np.swapaxes(h, -1, -2) @ h
        inverse = np.linalg.inv(gram)
        right = np.matmul(np.swapaxes(h, -1, -2), z[..., None])
        theta = np.matmul(inverse, right)[..., 0]
        squares = np.sum((z - np.matmul(h, theta[..., None])[..., 0]) ** 2, axis=-1)
        blocks, (n, p) = squares.size, h.shape[-2:]
        dof = blocks * (n - p)
        variance = float(np.sum(squares)) / dof
        gram_term = np.sum(np.broadcast_to(np.linalg.slogdet(gram)[1], squares.shape))
        deviance = dof * np.log(variance) + 2.0 * blocks * np.sum(np.log(np.diagonal(root))) + gram_term
        size = self._scale[..., 0, :]
        return _Solved(
            theta=theta / size,
            inverse=inverse / (size[..., :, None] * size[..., None, :]),
            squares=squares,
            variance=variance,
            deviance=float(deviance),
        )

    def best_shares(self) -> tuple[float, float]:
        """Shares of flicker and walk: their mean over the restricted likelihood; zero where the lot shows no wander.

        A slow drift within one record may be either, and the likelihood is flat between the two: its peak jumps from one
        answer to the other, its mean does not.
        """
        coarse = {pair: self._deviance(pair) for pair in product(_SHARES, repeat=2)}
        lowest = min(coarse.values())
        if coarse[0.0, 0.0] - lowest < _CHARGE:
            return 0.0, 0.0
        likely = np.array([pair for pair, deviance in coarse.items() if deviance - lowest < _FAR])
        flicker, walk = (_around(likely[:, k]) for k in range(2))
        pairs = np.array(list(product(flicker**2, walk**2)))
        deviance = np.array([self._deviance(pair) for pair in pairs.tolist()])
        near = pairs[deviance - deviance.min() < _FAR]
        flicker, walk = (_between(near[:, k]) for k in range(2))
        pairs = np.array(list(product(flicker**2, walk**2)))
        deviance = np.array([self._deviance(pair) for pair in pairs.tolist()])
        # half of the belief beforehand is that a kind of wander is not there at all
        belief = np.prod(np.where(pairs > 0.0, 1.0, _FINE - 1.0), axis=1)
        weight = belief * np.exp(-0.5 * (deviance - deviance.min()))
        mean = (weight @ pairs) / weight.sum()
        return float(mean[0]), float(mean[1])

    def _deviance(self, shares: Sequence[float]) -> float:
        return self.solve(shares).deviance


def _around(shares: Array) -> Array:
    """Standard deviations (_FINE,) to look at, one coarse step beyond those that are likely."""
    low, high = float(shares.min()) / _STEP, max(float(shares.max()), _SHARES[1]) * _STEP
    return np.linspace(low**0.5, high**0.5, _FINE)


def _between(shares: Array) -> Array:
    """Standard deviations (_FINE,) from the least to the largest of the shares."""
    return np.linspace(float(shares.min()) ** 0.5, float(shares.max()) ** 0.5, _FINE)
