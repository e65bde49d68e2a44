"""Axes in another order, or inverted."""

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def flipped(readings: Readings) -> Iterator[Fault]:
    """Axes in another order or with another sign: the best signed permutation of the response is not the identity."""
    axes = np.array(readings.axes)
    orders = np.array(list(permutations(range(3), axes.size)))
    for unit, fit in enumerate(readings.fits):
        if not readings.follows[unit]:
            continue
        k = fit[:, 1:] / max(float(readings.scale[unit]), 1e-300)
        rows = np.arange(len(k))
        columns = orders[np.argmax(np.abs(k)[rows, orders].sum(axis=1))]
        signs = np.sign(k[rows, columns])
        if np.min(np.abs(k[rows, columns])) < 0.6 or (np.array_equal(axes, columns) and np.all(signs > 0)):
            continue
        text = ", ".join(
            f"{'xyz'[i]} reads {'+' if s > 0 else '−'}{'xyz'[j]}" for i, j, s in zip(axes, columns, signs, strict=True)
        )
        yield Fault("axis_flip", unit, (), text)


LOOK = Look(flipped, ("axis_flip",), order=80)
