"""Noise of the norm of gravity between dwells: wander of an axis shows in it as far as the force points along that axis.

The residual |f| − g of a dwell is fᵀ/|f| times the three axes' errors. Axes that wander alike and independently therefore give
cov(ρ) = s²·(diag(e²) + (F·K_F + W·K_W) ∘ (u·uᵀ)) with the directions u of the force, flicker K_F and random walk K_W. Both
shares and s² are estimated with the coefficients' columns projected out (restricted likelihood). A run of bias and scale with
temperature that the model lacks is noise too, of a standard deviation that is stated.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from inertial.arrays import Array, Flags
from inertial.fits.wander import student
from inertial.noise.flicker import flicker_kernel
from inertial.noise.measurands import walk_kernel

_SHARES = np.concatenate([[0.0], 10.0 ** np.arange(-1.0, 5.0)])
_FINER = (10.0**0.5, 10.0**0.25)

RUN_PER_K = {"bias_temperature": 500e-6, "scale_temperature": 100e-6}
"""Standard deviation of the run with temperature of a bias, g/K, and of a scale factor, 1/K, of which nothing is known.

Data sheets of sensors of telephones and autopilots state 0.1 to 1.2 mg/K and 0.01 to 0.03 %/K. Of flights that warm by 4 K
(`benchmarks/field.py`) half and twice these values change the median U of a bias by 7 %, of a scale factor by 18 %, at most.
"""


def whitener_of_norms(residual: Array, rows: Array, direction: Array, time: Array, error: Array) -> Array:
    """Inverse root (n, n) of the covariance, over s², of the residuals (n,) of a norm fit.

    Parameters
    ----------
    rows : (n, p), derivatives by the coefficients; direction : (n, 3), unit vectors of the force
    time : (n,), s; error : (n,), white standard errors, any common unit
    """
    white = error / np.sqrt(np.mean(error**2))
    along = direction @ direction.T
    kernels = flicker_kernel(time) * along, walk_kernel(time) * along

    def root(flicker: float, walk: float) -> Array:
        return np.asarray(np.linalg.cholesky(np.diag(white**2) + flicker * kernels[0] + walk * kernels[1]), np.float64)

    def deviance(shares: tuple[float, float]) -> float:
        low = root(*shares)
        h, z = (np.asarray(solve_triangular(low, part, lower=True)) for part in (rows, residual))
        q, triangle = np.linalg.qr(h)
        left = z - q @ (q.T @ z)
        volume = np.log(np.diagonal(low)).sum() + np.log(np.abs(np.diagonal(triangle))).sum()
        return float((residual.size - rows.shape[1]) * np.log(max(left @ left, 1e-300)) + 2.0 * volume)

    best = min(((deviance((f, w)), (f, w)) for f in _SHARES.tolist() for w in _SHARES.tolist()), key=lambda fit: fit[0])
    for step in _FINER:
        f, w = best[1]
        near = [(f * a, w * b) for a in (1.0 / step, 1.0, step) for b in (1.0 / step, 1.0, step)]
        best = min([best, *((deviance(shares), shares) for shares in dict.fromkeys(near))], key=lambda fit: fit[0])
    return np.asarray(solve_triangular(root(*best[1]), np.eye(time.size), lower=True))


def runs_left_out(effects: Sequence[str], temperature: Array | None, direction: Array, there: Flags) -> Array:
    """What the runs with temperature that a model lacks add to the norms, (units, n, k), g: standard deviations by column.

    Coefficients of a fit with this noise hold at the mean temperature of the dwells. A dwell shows the run of an axis as far as
    the force points along it.

    Parameters
    ----------
    temperature : (units, n), °C; direction : (units, n, 3), unit vectors of the force
    there : (units, n), dwells of the fit; the columns of a unit with an unknown temperature among them are zero
    """
    if temperature is None:
        return np.zeros((*direction.shape[:2], 0))
    mean = np.mean(temperature, axis=1, where=there, keepdims=True)  # no number where one of the temperatures is none
    rise = np.nan_to_num(temperature - mean)[..., None]
    columns = {"bias_temperature": direction, "scale_temperature": direction**2}
    lacking = [RUN_PER_K[name] * rise * column for name, column in columns.items() if name not in effects]
    return np.concatenate([np.zeros((*direction.shape[:2], 0)), *lacking], axis=-1)


def with_runs(whiten: Array, columns: Array) -> Array:
    """A whitener (units, n, n), lower triangular, of noise to which columns (units, n, k) with unit variance are added."""
    white = whiten @ columns
    root = np.linalg.cholesky(np.eye(white.shape[-2]) + white @ np.swapaxes(white, -1, -2))
    return np.asarray(np.linalg.solve(root, whiten), dtype=np.float64)


def thin_whitener(error: Array, columns: Array) -> Array:
    """A whitener (units, n, 1 + k) of independent noise to which columns with unit variance are added, for long records.

    With white noise e and B = C/e = U·S·Wᵀ it is (I − A·Aᵀ)/e, A = U·√(1 − 1/√(1 + S²)): first 1/e, then A.

    Parameters
    ----------
    error : (units, n), infinite for dwells that are left out; columns : (units, n, k)
    """
    weight = np.where(np.isfinite(error), 1.0 / error, 0.0)[..., None]
    u, s, _ = np.linalg.svd(weight * columns, full_matrices=False)
    return np.concatenate([weight, u * np.sqrt(1.0 - 1.0 / np.sqrt(1.0 + s[..., None, :] ** 2))], axis=-1)


def whitened(whiten: Array, columns: Array) -> Array:
    """Columns (..., n, m) with white noise of one variance, by a whitener (..., n, n) or one of :func:`thin_whitener`."""
    if whiten.shape[-1] == whiten.shape[-2]:
        return np.asarray(whiten @ columns)
    weighted, along = whiten[..., :1] * columns, whiten[..., 1:]
    return np.asarray(weighted - along @ (np.swapaxes(along, -1, -2) @ weighted))


@dataclass(frozen=True)
class PlausibleNoise:
    """A noise that the residuals of a norm fit do not rule out.

    weight : of all of them, which add up to one
    whiten : as in :func:`fit_norms`; slow : (units, n, n), covariance of the wander of one axis between the dwells, g²
    """

    weight: float
    whiten: Array
    slow: Array


class SolvedNorms:
    """The linear fit of one unit about its solution, under one noise.

    Parameters
    ----------
    rows : (n, k), derivatives of the residuals; left : (n,), residuals
    whiten : of the noise, as :func:`whitened` takes it; least : smallest variance of the whitened residuals
    """

    def __init__(self, rows: Array, left: Array, weight: float, whiten: Array, least: float = 0.0) -> None:
        self.weight, self.least, self.whiten = weight, least, whiten
        white, rest = whitened(whiten, rows), whitened(whiten, left[:, None])[:, 0]
        size = np.linalg.norm(white, axis=0)
        self.size = np.where(size > 0.0, size, 1.0)
        self.unit = white / self.size
        self.inverse = np.linalg.pinv(self.unit.T @ self.unit, rcond=1e-13)
        self.step = self.inverse @ (self.unit.T @ rest)
        self.chi2 = max(float(rest @ rest - self.step @ (self.unit.T @ rest)), 0.0)

    @property
    def gain(self) -> Array:
        """Change (k, n) of the coefficients by the residuals, for a whitener (n, n)."""
        return self.inverse @ (self.unit.T @ self.whiten) / self.size[:, None]

    def covariance(self, dof: int) -> Array:
        """Second moment (k, k) about the solution: of the noise, with Student's factor for k = 2, and the step to the fit."""
        moment = student(dof) ** 2 * self._level(dof) * self.inverse + np.outer(self.step, self.step)
        return moment / np.outer(self.size, self.size)

    def _level(self, dof: int) -> float:
        """Variance of the whitened residuals."""
        return max(self.chi2 / dof, self.least)

    def of_record(
        self,
        columns: Sequence[int],
        direction: Array,
        slow: Array,
        share: Array,
        response: Array,
        dof: int,
        gain: Array,
    ) -> Array:
        """Mean square error (3,), under this noise, of the bias of a fit as that of its record, the mean wander included.

        Fits under two noises state two quantities as the bias: that at the first dwell, or about the mean. The steps between
        them are no error of the record.

        Parameters
        ----------
        columns : of the bias of each axis among the coefficients; share : (n,), of each dwell in the mean
        gain : (k, n), of the fit whose bias is stated
        """
        share = share / share.sum()
        level = student(dof) ** 2 * self._level(dof)
        common = slow @ share  # of the wander of an axis at each dwell with its mean
        mean = float(share @ common)
        used = np.any(self.whiten != 0.0, axis=-1)
        root = self.whiten[np.ix_(used, used)]
        squares = np.zeros(3)
        for axis, column in enumerate(columns):
            # the norm of a dwell shows the wander of an axis as far as the force points along it
            shown = -gain[column] @ (direction * common[:, None])
            noise = solve_triangular(root.T, gain[column, used])
            square = (
                float(noise @ noise)
                - 2.0 * float(response[axis] @ shown)
                + mean * float(response[axis] @ response[axis])
            )
            squares[axis] = level * max(square, 0.0)
        return squares
