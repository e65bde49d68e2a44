"""Exchanged serials where there are too few calibrations of a kind to know how it usually changes: told by the tolerances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipelines.audit.parameters import FAMILY_OF, NAMES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipelines.audit.calibrations import Calibrations
    from pipelines.audit.rules import Rules

    Array = NDArray[np.float64]
    Index = NDArray[np.int64]

COVERAGE = 2.0


def exchanged_pairs(all_: Calibrations, own: Index, before: Index, rules: Rules) -> list[tuple[int, int, float]]:
    """Two calibrations of one run that each fit the other unit's past and not their own: both ways, with their distance.

    A calibration fits a past where every parameter with a tolerance stays in it, or outside by no more than the uncertainty of
    both. The distance is from its own past, in tolerances (rms).

    Parameters
    ----------
    own : rows of one kind of device
    before : (m,), of each the place among them of the unit's calibration before; −1 where there is none
    """
    device = str(all_.device[own[0]]) if own.size else ""
    bound = np.array([rules.tolerance_of(device, FAMILY_OF[name]) for name in NAMES])
    found, past = list[tuple[int, int, float]](), [int(own[place]) for place in before]
    for run in np.unique(all_.run[own[before >= 0]].astype(str)):
        here = np.flatnonzero((all_.run[own] == run) & (before >= 0))
        far = [int(k) for k in here if not _fits(all_, own[k], past[k], bound)]
        found += [
            (k, other, _distance(all_, own[k], past[k], bound))
            for k in far
            for other in far
            if k != other and _fits(all_, own[k], past[other], bound) and _fits(all_, own[other], past[k], bound)
        ]
    return found


def _fits(all_: Calibrations, row: int, past: int, bound: Array) -> bool:
    change = np.abs(all_.values[row] - all_.values[past])
    expanded = COVERAGE * np.hypot(all_.errors[row], all_.errors[past])
    told = np.isfinite(change) & np.isfinite(
        bound
    )  # what a model has not is NaN, and says nothing; nothing at all fits nothing
    return bool(told.any() and np.all(change[told] <= (bound + expanded)[told]))


def _distance(all_: Calibrations, row: int, past: int, bound: Array) -> float:
    return float(np.sqrt(np.nanmean(((all_.values[row] - all_.values[past]) / bound)[np.isfinite(bound)] ** 2)))
