"""Exchanged serials among few calibrations of a kind, whose usual change is unknown: detected by the tolerances."""

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


def exchanged_pairs(
    calibrations: Calibrations, own: Index, before: Index, rules: Rules
) -> list[tuple[int, int, float]]:
    """Pairs of calibrations of one run that fit each other's history and not their own; both directions, with the distance.

    A calibration fits a history where every parameter with a tolerance stays in it, or outside by at most the uncertainty of
    both. The distance is to its own history, in tolerances (rms).

    Parameters
    ----------
    own : rows of one kind of device
    before : (m,), index among them of the unit's previous calibration; −1 without one
    """
    device = str(calibrations.device[own[0]]) if own.size else ""
    bound = np.array([rules.tolerance_of(device, FAMILY_OF[name]) for name in NAMES])
    pairs, past = list[tuple[int, int, float]](), [int(own[place]) for place in before]
    for run in np.unique(calibrations.run[own[before >= 0]].astype(str)):
        here = np.flatnonzero((calibrations.run[own] == run) & (before >= 0))
        far = [int(k) for k in here if not _fits(calibrations, own[k], past[k], bound)]
        pairs += [
            (k, other, _distance(calibrations, own[k], past[k], bound))
            for k in far
            for other in far
            if k != other
            and _fits(calibrations, own[k], past[other], bound)
            and _fits(calibrations, own[other], past[k], bound)
        ]
    return pairs


def _fits(calibrations: Calibrations, row: int, past: int, bound: Array) -> bool:
    change = np.abs(calibrations.values[row] - calibrations.values[past])
    expanded = COVERAGE * np.hypot(calibrations.errors[row], calibrations.errors[past])
    known = np.isfinite(change) & np.isfinite(
        bound
    )  # parameters outside the model are NaN and are ignored; without any parameter nothing fits
    return bool(known.any() and np.all(change[known] <= (bound + expanded)[known]))


def _distance(calibrations: Calibrations, row: int, past: int, bound: Array) -> float:
    return float(
        np.sqrt(np.nanmean(((calibrations.values[row] - calibrations.values[past]) / bound)[np.isfinite(bound)] ** 2))
    )
