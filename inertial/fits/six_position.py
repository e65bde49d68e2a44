"""Six positions in closed form: bias and scale of each axis from its face up and its face down."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


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
        msg = f"six position: means of shape {plus.shape} and {minus.shape}, (..., 3, 3) each is needed: face by output"
        raise ValueError(msg)
    centre = 0.5 * (plus + minus)
    response = np.swapaxes(plus - minus, -1, -2) / (2.0 * local_gravity)
    return SixPosition(
        bias=np.diagonal(centre, axis1=-2, axis2=-1).copy(),
        scale=np.diagonal(response, axis1=-2, axis2=-1).copy(),
        response=response,
    )
