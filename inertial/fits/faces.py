"""Six faces: bias and scale in closed form, the published method, and the least squares that show the lack of fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import f as f_distribution

from inertial.arrays import Array


@dataclass(frozen=True)
class Ferraris:
    """The published answer, in closed form: output = K·R·f + b, of one unit or of a batch."""

    scale: Array
    """(..., 3, 3) diagonal K, output unit per unit of gravity."""
    rotation: Array
    """(..., 3, 3) R, unit rows: directions of the sensitive axes."""
    bias: Array
    """(..., 3) output unit."""

    @property
    def response(self) -> Array:
        """K·R (..., 3, 3), output unit per unit of gravity: column j from the pair along axis j."""
        return self.scale @ self.rotation


@dataclass(frozen=True)
class Faces:
    """Least squares of all eighteen means: bias and full response, and what six degrees of freedom say about them."""

    bias: Array
    """(3,) output unit."""
    response: Array
    """(3, 3) K, output unit per unit of gravity."""
    residuals: Array
    """(6, 3) means less model, output unit: +x, +y, +z, -x, -y, -z by output."""
    rms: Array
    """(3,) root of residual squares over their two degrees of freedom, output unit."""
    pure_error: Array
    """(3,) standard error of a face's mean from the samples, output unit; NaN where not given."""
    p_value: Array
    """(3,) probability of this lack of fit if faces were exact and the samples' noise were all; NaN where unknown."""


def ferraris(up: ArrayLike, down: ArrayLike, gravity: float) -> Ferraris:
    """K, R and b of the published method.

    Bias = diagonal of (U_p + U_a)/2, K·R = (U_p - U_a)/(2g) with U[i, j] the mean of output i while axis j is up (p) or
    down (a); K holds the row norms, R the unit rows. F. Ferraris, U. Grimaldi and M. Parvis, "Procedure for effortless
    in-field calibration of three-axial rate gyro and accelerometers", Sensors and Materials 7 (1995) 311. Six of the
    eighteen means' degrees of freedom are thrown away. Mounting errors of the faces enter K·R in full (17 mg per degree).

    Parameters
    ----------
    up, down : (..., 3, 3), output unit; [j, i] is output i while axis j points up, down
    gravity : the specific force of a face, in the unit wanted (g or m/s²)
    """
    # U, as published
    plus, minus = (np.swapaxes(np.asarray(means, dtype=np.float64), -1, -2) for means in (up, down))
    response = (plus - minus) / (2.0 * gravity)
    size = np.linalg.norm(response, axis=-1)
    bias = np.diagonal(0.5 * (plus + minus), axis1=-2, axis2=-1).copy()
    return Ferraris(size[..., None] * np.eye(3), response / size[..., None], bias)


def faces(up: ArrayLike, down: ArrayLike, gravity: float, standard_error: ArrayLike | None = None) -> Faces:
    """Bias and response from all eighteen means, with the lack of fit that six degrees of freedom show.

    Each output has six means and four unknowns. A bias that differs between the pairs (a tilted face, a second-order
    term, a temperature that moved) shows in the residuals.

    Parameters
    ----------
    up, down : (3, 3), output unit; [j, i] is output i while axis j points up, down
    gravity : the specific force of a face, in the unit wanted (g or m/s²)
    standard_error : (3,), output unit; of one mean, from the samples
    """
    means = np.concatenate([np.asarray(up, dtype=np.float64), np.asarray(down, dtype=np.float64)])
    design = np.column_stack([np.ones(6), np.concatenate([np.eye(3), -np.eye(3)]) * gravity])
    theta = np.asarray(np.linalg.lstsq(design, means, rcond=None)[0], dtype=np.float64)
    residuals = means - design @ theta
    rms = np.sqrt(np.sum(residuals**2, axis=0) / 2.0)
    pure = np.full(3, np.nan) if standard_error is None else np.asarray(standard_error, dtype=np.float64)
    # the samples' own degrees of freedom are many: chi-square over 2 is F with 2 and infinity
    p_value = np.where(np.isnan(pure), np.nan, f_distribution.sf((rms / pure) ** 2, 2, 1e9))
    return Faces(theta[0], theta[1:].T, residuals, rms, pure, p_value)
