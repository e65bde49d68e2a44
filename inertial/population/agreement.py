"""Agreement of two results with their uncertainties."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

COVERAGE = 2.0


def e_n(new: Array, old: Array, new_error: Array, old_error: Array) -> Array:
    """The E_n number of two results: their difference over the root sum of squares of their expanded uncertainties, k = 2.

    |E_n| ≤ 1 agrees (ISO/IEC 17043:2010, B.3.1.3; ISO 13528:2015, 9.7). Standard uncertainties are given.
    """
    return (new - old) / (COVERAGE * np.sqrt(new_error**2 + old_error**2))
