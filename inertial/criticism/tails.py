"""Tails of the noise: how far a dwell may be off where large values are common.

Whether tails are heavy is judged by the kurtosis of the deletion residuals of all dwells that were kept (Anscombe & Glynn,
Biometrika 70 (1983) 227); whitened residuals would not do, as whitening spreads what one dwell is off over those that follow.
What was left out does not count: dwells that are off would pass for tails themselves. Beyond the values that were kept, heavy
tails are taken to fall off as those of a t distribution with three degrees of freedom, P(|x| > z) ∝ z⁻³: few are heavier.
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
"""By which heavy tails fall off."""

_TELLS = 60
"""Values below which tails are not told from a normal distribution's."""


def with_tails(model: Model, removed: Sequence[BadDwell]) -> list[BadDwell]:
    """Dwells that were left out of a model, each marked where noise with the tails of the others reaches as far.

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
    """Whether values (m,) have more large ones among them than a normal distribution."""
    return values.size >= _TELLS and float(stats.kurtosistest(values, alternative="greater").pvalue) < HEAVY
