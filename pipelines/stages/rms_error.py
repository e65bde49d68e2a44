"""Standard uncertainty of the RMS error over dwells with correlated errors."""

from collections.abc import Sequence

import numpy as np

from inertial.arrays import Array
from schemas.units import AXES

OF_UNITS = ("rms_uncertainty_{}_ug", "rms_expected_{}_ug", "rms_dof_{}")
"""Columns that are the same in all rows of a unit, for each axis."""
_TINY = float(np.finfo(float).tiny)
_NODES, _RAW = np.polynomial.hermite_e.hermegauss(24)
_WEIGHTS = _RAW / np.sqrt(2.0 * np.pi)


def rms_columns(errors: Array, covariance: Array, letters: Sequence[str] = AXES) -> dict[str, Array]:
    """Columns of a verification that are equal for all dwells of a unit, (...,) each, by name.

    For each axis: uncertainty of the RMS, RMS expected of a correct model, and degrees of freedom of its square.

    Parameters
    ----------
    errors : (..., 3, m); covariance : (..., 3, m, m), of a correct model, the square of the errors' unit
    """
    trace = np.einsum("...jj->...", covariance)
    freedom = trace**2 / np.maximum(np.einsum("...jk,...jk->...", covariance, covariance), _TINY)
    values = rms_uncertainty(errors, covariance), np.sqrt(trace / errors.shape[-1]), freedom
    return {
        name.format(letter): value[..., axis]
        for name, value in zip(OF_UNITS, values, strict=True)
        for axis, letter in enumerate(letters)
    }


def rms_uncertainty(error: Array, covariance: Array) -> Array:
    """Standard uncertainty of the RMS r = √(eᵀe/m) of errors e = μ + noise with covariance Σ.

    For normal noise E(eᵀe) = μᵀμ + tr Σ and Var(eᵀe) = 4·μᵀΣμ + 2·tr Σ². The unknown μ is taken as the share of e by which eᵀe
    exceeds the noise plus one standard deviation, tr Σ + √(2·tr Σ²); with a larger share the uncertainty of errors that are noise
    alone would be a fifth too large on average. eᵀe is approximated by c + g·χ² of ν degrees of freedom with the same first three
    cumulants (Pearson; J. P. Imhof, Biometrika 48 (1961) 419), which gives the standard deviation of its root. Under wander m
    dwells count as one or two: there linearisation of the root gives up to 1.66 times the standard deviation, and the formula for
    white errors, rms/√(2m), far too small a value.

    Parameters
    ----------
    error : (..., m); covariance : (..., m, m), the square of the error's unit

    Returns
    -------
    (...,), the error's unit
    """
    m = error.shape[-1]
    moved = np.einsum("...jk,...k->...j", covariance, error)
    squared = covariance @ covariance
    traces = [np.einsum("...jj->...", matrix) for matrix in (covariance, squared)]
    traces.append(np.einsum("...jk,...kj->...", squared, covariance))
    square = np.sum(error**2, axis=-1)
    share = np.maximum(1.0 - (traces[0] + np.sqrt(2.0 * traces[1])) / np.maximum(square, _TINY), 0.0)
    mean = traces[0] + share * square
    second = 2.0 * (traces[1] + 2.0 * share * np.sum(error * moved, axis=-1)) / np.maximum(mean**2, _TINY)
    third = 8.0 * (traces[2] + 3.0 * share * np.sum(moved**2, axis=-1)) / np.maximum(mean**3, _TINY)
    return np.sqrt(mean / m) * _spread_of_root(second, third)


def _spread_of_root(second: Array, third: Array) -> Array:
    """Standard deviation of the root of a positive sum of squares of mean 1 with given second and third cumulants.

    For χ²/ν it is 0.603 with one degree of freedom, and 1/√(2ν) with many. χ² is approximated by the cube of a normal variable
    (Wilson and Hilferty, Proc. Nat. Acad. Sci. 17 (1931) 684).
    """
    dof = np.clip(8.0 * second**3 / np.maximum(third**2, _TINY), 0.5, 1e8)
    width = np.sqrt(0.5 * second / dof)
    cube = (1.0 - 2.0 / (9.0 * dof))[..., None] + np.sqrt(2.0 / (9.0 * dof))[..., None] * _NODES
    value = 1.0 - (width * dof)[..., None] + (width * dof)[..., None] * np.maximum(cube, 0.0) ** 3
    root = np.sqrt(np.maximum(value, 0.0))
    middle = root @ _WEIGHTS
    return np.sqrt(np.maximum((root - middle[..., None]) ** 2 @ _WEIGHTS, 0.0))
