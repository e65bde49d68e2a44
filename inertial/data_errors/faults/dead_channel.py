"""An axis that does not respond to gravity."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def dead(readings: Readings) -> Iterator[Fault]:
    """An axis that does not respond to gravity."""
    for unit, fit in enumerate(readings.fits):
        size = np.linalg.norm(fit[:, 1:], axis=1)
        weak = np.flatnonzero(size < 0.2 * np.median(size)) if np.median(size) > 0.0 else np.arange(size.size)
        for axis in weak[:1]:
            share = size[axis] / max(float(np.median(size)), 1e-300)
            evidence = (
                f"axis {'xyz'[readings.axes[axis]]} responds to gravity with {share:.1%} of the other axes' scale"
            )
            yield Fault("dead_channel", unit, (), evidence)


LOOK = Look(dead, ("dead_channel",), order=60)
