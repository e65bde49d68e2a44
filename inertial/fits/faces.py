"""Six faces: bias and scale in closed form, the published method, and the least squares that show the lack of fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import f as f_distribution

from inertial.arrays import Array


@dataclass(frozen=True)
class Ferraris:
    """The published answer: output = K·R·f + b."""

    scale: Array
    """(3, 3) diagonal K, output unit per unit of gravity."""
    rotation: Array
    """(3, 3) R, unit rows: directions of the sensitive axes."""
    bias: Array
    """(3,) output unit."""

    def predict(self, force: Array) -> Array:
        """Output (n, 3) at the specific force (n, 3)."""
        return force @ (self.scale @ self.rotation).T + self.bias


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

    def predict(self, force: Array) -> Array:
        """Output (n, 3) at the specific force (n, 3)."""
        return force @ self.response.T + self.bias


def ferraris(up: ArrayLike, down: ArrayLike, gravity: float) -> Ferraris:
    """K, R and b of the published method.

    Bias = diagonal of (U_p + U_a)/2, K·R = (U_p - U_a)/(2g) with U[i, j] the mean of output i while axis j is up (p) or
    down (a); K holds the row norms, R the unit rows. F. Ferraris, U. Grimaldi and M. Parvis, "Procedure for effortless
    in-field calibration of three-axial rate gyro and accelerometers", Sensors and Materials 7 (1995) 311. Six of the
    eighteen means' degrees of freedom are thrown away.

    Parameters
    ----------
    up, down : (3, 3), output unit; [j, i] is output i while axis j points up, down
    gravity : the specific force of a face, in the unit wanted (g or m/s²)
    """
    plus, minus = (np.asarray(means, dtype=np.float64).T for means in (up, down))  # U, as published
    response = (plus - minus) / (2.0 * gravity)
    size = np.linalg.norm(response, axis=1)
    return Ferraris(np.diag(size), response / size[:, None], np.diagonal(0.5 * (plus + minus)).copy())


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


@dataclass(frozen=True)
class SixPosition:
    """Bias and sensitivity of each axis, and what the cross axes show."""

    bias: Array
    """(..., 3) b = (a₊ + a₋)/2, output unit."""
    scale: Array
    """(..., 3) sensitivity (a₊ - a₋)/(2g), output unit per g."""
    response: Array
    """(..., 3, 3) K, output unit per g: column j from the pair along axis j."""

    def scale_error(self, nominal: float = 1.0) -> Array:
        """S = (a₊ - a₋)/(2g·nominal) - 1, (..., 3), relative."""
        return self.scale / nominal - 1.0

    def apply(self, output: ArrayLike) -> Array:
        """Specific force (..., n, 3) in g: K⁻¹·(a - b)."""
        centred = np.asarray(output, dtype=np.float64) - self.bias[..., None, :]
        force = np.linalg.solve(self.response[..., None, :, :], centred[..., None])
        return np.asarray(force[..., 0], dtype=np.float64)


def six_position(up: ArrayLike, down: ArrayLike, local_gravity: float) -> SixPosition:
    """Closed form of the six-position test: b = (a₊ + a₋)/2, S = (a₊ - a₋)/(2g) - 1.

    With exact faces the same numbers as least squares of bias, scale and misalignment on each axis' own pair; the other
    axes' means during the pair give the misalignments. Mounting errors of the faces enter them in full (17 mg per degree).

    Parameters
    ----------
    up : (..., 3, 3), output unit; [j, i] is output i while axis j points up
    down : (..., 3, 3), output unit; the same with axis j down
    local_gravity : g
    """
    plus, minus = np.asarray(up, dtype=np.float64), np.asarray(down, dtype=np.float64)
    if plus.shape[-2:] != (3, 3) or minus.shape != plus.shape:
        raise ValueError(
            f"six position: means of shape {plus.shape} and {minus.shape}, (..., 3, 3) each is needed: face by output"
        )
    centre = 0.5 * (plus + minus)
    response = np.swapaxes(plus - minus, -1, -2) / (2.0 * local_gravity)
    return SixPosition(
        bias=np.diagonal(centre, axis1=-2, axis2=-1).copy(),
        scale=np.diagonal(response, axis1=-2, axis2=-1).copy(),
        response=response,
    )
