"""Standard uncertainty of the RMS error over dwells with correlated errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def rms_uncertainty(error: Array, covariance: Array) -> Array:
    """Standard uncertainty of the RMS r = √(eᵀe/m) of errors e = μ + noise of the covariance Σ.

    Var(eᵀe) = 4·μᵀΣμ + 2·tr Σ² for normal noise. μ is not known, and E(eᵀΣe) = μᵀΣμ + tr Σ²: so 4·eᵀΣe − 2·tr Σ² estimates it,
    taken as 2·tr Σ² where it is less. If r is of the size of the noise, the root cannot be linearised: u is at most √(tr Σ/m),
    the value of r in this case. rms/√(2m) is valid for white errors only: with wander over a run, m dwells are worth one or two.

    Parameters
    ----------
    error : (..., m); covariance : (..., m, m), the square of the error's unit

    Returns
    -------
    (...,), the error's unit
    """
    m = error.shape[-1]
    noise = np.einsum("...jk,...kj->...", covariance, covariance)
    along = np.einsum("...j,...jk,...k->...", error, covariance, error)
    variance = np.maximum(4.0 * along - 2.0 * noise, 2.0 * noise)
    rms = np.sqrt(np.mean(error**2, axis=-1))
    ceiling = np.sqrt(np.einsum("...jj->...", covariance) / m)
    linear = np.sqrt(variance) / np.maximum(2.0 * m * rms, np.finfo(float).tiny)
    return np.minimum(linear, ceiling)
