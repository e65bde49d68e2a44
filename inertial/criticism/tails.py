"""Tails of the noise: limit for bad dwells if large deviations are frequent.

Whether tails are heavy is judged by the kurtosis of the deletion residuals of all dwells that were kept (Anscombe & Glynn,
Biometrika 70 (1983) 227); whitened residuals would not do, because whitening spreads the deviation of one dwell over the
following ones. Dwells left out do not count: bad dwells would look like tails. Beyond the values that were kept, heavy tails are
assumed to decay as those of a t distribution with three degrees of freedom, P(|x| > z) ∝ z⁻³: few are heavier.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inertial.criticism.bad_dwells import BadDwell, deletion_residuals
from inertial.criticism.decisions import BAD_DWELL, HEAVY
from inertial.criticism.model import Model

Array = NDArray[np.float64]

_FROM = 3.0
"""Standard deviations from which values count as tails."""

_POWER = 3.0
"""Exponent of the decay of heavy tails."""

_TELLS = 60
"""Fewest values for a test of the tails."""


def with_tails(model: Model, removed: Sequence[BadDwell]) -> list[BadDwell]:
    """Dwells that were left out of a model, each marked if it is within noise with the tails of the others.

    Parameters
    ----------
    model : without these dwells
    """
    values = deletion_residuals(model)
    if not heavy(values):
        return list(removed)
    beyond = max(int(np.count_nonzero(np.abs(values) > _FROM)), 1)
    return [replace(d, tail=beyond * (_FROM / d.deviations) ** _POWER >= BAD_DWELL) for d in removed]


def heavy(values: Array) -> bool:
    """Whether values (m,) have heavier tails than a normal distribution."""
    return values.size >= _TELLS and float(stats.kurtosistest(values, alternative="greater").pvalue) < HEAVY
