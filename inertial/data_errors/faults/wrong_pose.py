"""Dwells in another pose than the one commanded."""

from collections.abc import Iterator

import numpy as np

from inertial.arrays import Places
from inertial.data_errors.exchanged import PlainFit
from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import FAR_G, Array, Readings

_COMMON = 5.0
"""Median over the units of the misfit over the usual one, from which on the pose of a dwell is wrong for all units."""


def wrong_poses(readings: Readings) -> Iterator[Fault]:
    """Dwells whose output belongs to another direction of gravity than the one commanded."""
    steady = readings.without_bias_slope
    size = np.linalg.norm(steady.misfit, axis=-1)
    typical = np.nanmedian(size, axis=1, keepdims=True)
    out = size > np.maximum(FAR_G, 15.0 * typical)
    if len(out) > 2:
        # an error of most units belongs to the plan or the table: the search for effects reports it
        ratio = np.nanmedian(size / np.where(typical > 0.0, typical, np.inf), axis=0, keepdims=True)
        out &= ratio < _COMMON
    # exchanged units are also left to the search for effects
    swapped = set(_exchanged(readings)) if out.any() else set[int]()
    for unit, row in enumerate(out):
        dwells = np.flatnonzero(row)
        if not dwells.size or dwells.size > 0.4 * row.size or unit in swapped:
            continue
        felt = _felt(steady, unit, dwells)
        turned = np.abs(np.linalg.norm(felt, axis=-1) - 1.0) < 0.02
        if not turned.any():
            continue
        name, text = _which_pose(readings.force[unit], dwells[turned], felt[turned])
        yield Fault(name, unit, tuple(dwells[turned].tolist()), text)


def _exchanged(readings: Readings) -> Iterator[int]:
    """Units that have the readings of another one in a range of dwells."""
    warm = readings.warm
    theta = None if warm is None or not np.isfinite(warm[readings.there]).all() else warm
    output = readings.output
    fit = PlainFit(output, readings.force, theta, readings.there, lambda unit, partner: output[[partner, unit]])
    for pair in fit.pairs():
        if fit.ranges(*pair):
            yield from pair


def _felt(readings: Readings, unit: int, dwells: Places) -> Array:
    """Specific force, (k, 3), g, from the outputs of some dwells by the unit's calibration."""
    fit = readings.fits[unit]
    return (np.linalg.pinv(fit[:, 1:]) @ (readings.output[unit, dwells] - fit[:, 0]).T).T


def _which_pose(force: Array, dwells: Places, felt: Array) -> tuple[str, str]:
    for i, a in enumerate(dwells):
        for j in range(i + 1, len(dwells)):
            b = dwells[j]
            if np.linalg.norm(felt[i] - force[b]) < 0.05 and np.linalg.norm(felt[j] - force[a]) < 0.05:
                return "swapped_dwells", f"dwells {{dwell[{a}]}} and {{dwell[{b}]}} have exchanged poses"
    angle = np.degrees(np.arccos(np.clip(np.sum(felt[0] * force[dwells[0]]), -1.0, 1.0)))
    return "wrong_pose", f"dwell {{dwell[{dwells[0]}]}} was measured {angle:.1f}° from the commanded pose"


LOOK = Look(wrong_poses, ("swapped_dwells", "wrong_pose"), order=100)
