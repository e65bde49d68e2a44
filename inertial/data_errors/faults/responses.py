"""Faults of a unit's response to gravity: a dead axis, a scale unlike the lot, exchanged or inverted axes."""

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from inertial.data_errors.faults.fault import Fault, look
from inertial.data_errors.readings import Readings

_ORDERS = np.array(list(permutations(range(3))))
"""All orders of three axes."""


@look(60)
def dead(readings: Readings) -> Iterator[Fault]:
    """An axis that does not respond to gravity."""
    for unit, fit in enumerate(readings.fits):
        size = np.linalg.norm(fit[:, 1:], axis=1)
        weak = np.flatnonzero(size < 0.2 * np.median(size)) if np.median(size) > 0.0 else np.arange(3)
        for axis in weak[:1]:
            share = size[axis] / max(float(np.median(size)), 1e-300)
            evidence = f"axis {'xyz'[axis]} responds to gravity with {share:.1%} of the other axes' scale"
            yield Fault("dead_channel", unit, (), evidence)


@look(70)
def scale_units(readings: Readings) -> Iterator[Fault]:
    """A unit whose scale is far from its lot's."""
    scale = readings.scale
    for unit in range(scale.size):
        alone = 1.0 if readings.unit_name == "g" else float(scale[unit])
        others = float(np.median(np.delete(scale, unit))) if scale.size > 2 else alone
        ratio = float(scale[unit]) / others
        if not 0.75 < ratio < 1.33:
            yield Fault(_kind(ratio), unit, (), f"scale is {ratio:.4g} times that of the lot")


def _kind(ratio: float) -> str:
    octaves = np.log2(ratio)
    return "wrong_range" if abs(octaves - round(octaves)) < 0.06 and abs(round(octaves)) <= 4 else "wrong_units"


@look(80)
def flipped(readings: Readings) -> Iterator[Fault]:
    """Axes in another order or with another sign: the best signed permutation of the response is not the identity."""
    for unit, fit in enumerate(readings.fits):
        k = fit[:, 1:] / max(float(readings.scale[unit]), 1e-300)
        rows = np.arange(3)
        columns = _ORDERS[np.argmax(np.abs(k)[rows, _ORDERS].sum(axis=1))]
        signs = np.sign(k[rows, columns])
        if np.min(np.abs(k[rows, columns])) < 0.6 or (np.array_equal(rows, columns) and np.all(signs > 0)):
            continue
        text = ", ".join(
            f"{'xyz'[i]} reads {'+' if s > 0 else '−'}{'xyz'[j]}" for i, j, s in zip(rows, columns, signs, strict=True)
        )
        yield Fault("axis_flip", unit, (), text)
