"""Errors of a fit under the norm condition: the linear fit of one unit about its solution, under one plausible noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from inertial.fits.wander import student

Array = NDArray[np.float64]


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
    whiten : (n, n) or (n,), of the noise; least : smallest variance of the whitened residuals
    """

    def __init__(self, rows: Array, left: Array, weight: float, whiten: Array, least: float = 0.0) -> None:
        self.weight, self.least, self.whiten = weight, least, whiten
        white = whiten[:, None] * rows if whiten.ndim == 1 else whiten @ rows
        rest = whiten * left if whiten.ndim == 1 else whiten @ left
        size = np.linalg.norm(white, axis=0)
        self.size = np.where(size > 0.0, size, 1.0)
        unit = white / self.size
        self.inverse = np.linalg.pinv(unit.T @ unit, rcond=1e-13)
        self.step = self.inverse @ (unit.T @ rest)
        self.chi2 = max(float(rest @ rest - self.step @ (unit.T @ rest)), 0.0)
        self.gain = self.inverse @ (unit.T * whiten if whiten.ndim == 1 else unit.T @ whiten) / self.size[:, None]

    def covariance(self, dof: int) -> Array:
        """Second moment (k, k) about the solution: of the noise, with Student's factor for k = 2, and the step to the fit."""
        moment = student(dof) ** 2 * self._level(dof) * self.inverse + np.outer(self.step, self.step)
        return moment / np.outer(self.size, self.size)

    def _level(self, dof: int) -> float:
        """Variance of the whitened residuals."""
        return max(self.chi2 / dof, self.least)

    def of_record(
        self,
        places: Sequence[int],
        direction: Array,
        slow: Array,
        share: Array,
        response: Array,
        dof: int,
        gain: Array,
    ) -> Array:
        """Mean square error (3,), under this noise, of the bias of a fit as that of its record, the mean wander included.

        The bias of one noise's own fit is another quantity than that of another's: at the first dwell, or about the mean. The
        steps between them are no error of the record.

        Parameters
        ----------
        places : of the bias of each axis among the coefficients; share : (n,), of each dwell in the mean
        gain : (k, n), of the fit whose bias is stated
        """
        share = share / share.sum()
        level = student(dof) ** 2 * self._level(dof)
        common = slow @ share  # of the wander of an axis at each dwell with its mean
        mean = float(share @ common)
        used = np.any(self.whiten != 0.0, axis=-1)
        root = self.whiten[np.ix_(used, used)]
        squares = np.zeros(3)
        for axis, place in enumerate(places):
            # the norm of a dwell shows the wander of an axis as far as the force points along it
            shown = -gain[place] @ (direction * common[:, None])
            noise = solve_triangular(root.T, gain[place, used])
            square = (
                float(noise @ noise)
                - 2.0 * float(response[axis] @ shown)
                + mean * float(response[axis] @ response[axis])
            )
            squares[axis] = level * max(square, 0.0)
        return squares
