"""An output that repeats itself in new poses, or has no scatter."""

from collections.abc import Iterator

import numpy as np

from inertial.arrays import Places
from inertial.counts import number_of
from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings

_COARSE = 2.0
"""Misfit over a large scatter up to which an output without scatter still follows the pose.

Samples of a dwell midway between two codes, a step q apart, scatter by q/2; the misfit of a dwell with one code is at most q/2.
"""

_LARGE = 0.9
"""Quantile of an axis' scatters that counts as large: at steps of eight times the noise, a fifth of the dwells have two codes."""


def stuck(readings: Readings) -> Iterator[Fault]:
    """Outputs equal to the last digit in dwells of different poses; or samples of a dwell that are all equal."""
    for unit, out in enumerate(readings.output):
        still = _still(readings, unit)
        if still.size:
            evidence = (
                f"an axis is constant in {number_of(still.size, 'dwell')}: it has no scatter, unlike in the others"
            )
            yield Fault("stuck_output", unit, tuple(still.tolist()), evidence)
            continue
        moved = np.linalg.norm(np.diff(readings.force[unit], axis=0), axis=-1) > 0.05
        same = (np.diff(out, axis=0) == 0.0).any(axis=-1) & moved
        if np.count_nonzero(same) >= 2:
            dwells = np.flatnonzero(same) + 1
            yield Fault(
                "stuck_output",
                unit,
                tuple(dwells.tolist()),
                f"output repeats exactly in {number_of(dwells.size, 'dwell')} of new poses",
            )


def _still(readings: Readings, unit: int) -> Places:
    """Dwells in which an axis has no scatter (up to rounding) although it has in most."""
    if readings.spread is None or readings.count is None:
        return np.zeros(0, dtype=np.intp)
    spread = np.where((readings.count[unit] > 2.0)[:, None], readings.spread[unit], np.nan)
    if not np.isfinite(spread).any(axis=0).all():
        return np.zeros(0, dtype=np.intp)
    usual, large = np.nanquantile(spread, (0.5, _LARGE), axis=0)
    still = (spread < 1e-6 * usual) & (usual > 0.0)
    if readings.turned:
        # a coarse converter gives the same code for all samples of a dwell; it changes with the pose, so it is not stuck
        still &= ~(np.abs(readings.misfit_when_warm[unit]) * readings.scale[unit] < _COARSE * large)
    return np.flatnonzero(np.any(still, axis=-1))


LOOK = Look(stuck, ("stuck_output",), order=40)
