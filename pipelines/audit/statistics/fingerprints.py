"""Units told by their coefficients: whether a calibration fits the unit that its serial names, and whom it fits instead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Index = NDArray[np.int64]

TO_SIGMA = 1.4826
FOREIGN_P = 1e-9  # probability of a distance at which a calibration counts as not of its unit
ALIKE_P = 1e-3  # … and above which another unit's earlier calibration fits it
TELLING = 5.0  # spread between units over change of one unit, below which a parameter tells nobody apart


@dataclass(frozen=True)
class Scale:
    """How far parameters change from one calibration of a unit to the next, (p,), and which of them tell units apart."""

    change: Array
    telling: NDArray[np.bool_]

    @property
    def count(self) -> int:
        """Number of parameters that tell units apart."""
        return int(self.telling.sum())


def change_scale(values: Array, before: Array) -> Scale:
    """Robust spread of the change between neighbouring calibrations, against the spread between units.

    Parameters
    ----------
    values, before : (pairs, p), parameters of a calibration and of the one before it of the same serial
    """
    change = TO_SIGMA * np.median(np.abs(values - before - np.median(values - before, axis=0)), axis=0)
    between = TO_SIGMA * np.median(np.abs(values - np.median(values, axis=0)), axis=0)
    return Scale(change, (change > 0.0) & (between > TELLING * change))


def distance(values: Array, others: Array, scale: Scale) -> Array:
    """Squared distance in units of the usual change, summed over the telling parameters; broadcast over (…, p)."""
    z = (values - others)[..., scale.telling] / scale.change[scale.telling]
    return np.sum(z**2, axis=-1)


def foreign_above(scale: Scale) -> float:
    """Squared distance beyond which a calibration is not of the unit it is said to be of."""
    return float(chi2.isf(FOREIGN_P, max(scale.count, 1)))


def alike_below(scale: Scale) -> float:
    """Squared distance within which it may be of a unit."""
    return float(chi2.isf(ALIKE_P, max(scale.count, 1)))


def nearest(value: Array, others: Array, scale: Scale) -> tuple[int, float]:
    """Which row of ``others`` (n, p) is nearest to ``value`` (p,), and its squared distance."""
    distances = distance(value, others, scale)
    best = int(np.argmin(distances))
    return best, float(distances[best])
