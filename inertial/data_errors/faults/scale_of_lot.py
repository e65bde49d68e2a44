"""A scale unlike that of the lot: another range, or another unit."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def scale_units(readings: Readings) -> Iterator[Fault]:
    """A unit whose scale is far from its lot's."""
    scale = readings.scale
    for unit in range(scale.size):
        alone = 1.0 if readings.unit_name == "g" else float(scale[unit])
        others = float(np.median(np.delete(scale, unit))) if scale.size > 2 else alone
        ratio = float(scale[unit]) / others
        if not 0.75 < ratio < 1.33:
            octaves = np.log2(ratio)
            octave = abs(octaves - round(octaves)) < 0.06 and abs(round(octaves)) <= 4
            yield Fault(
                "wrong_range" if octave else "wrong_units", unit, (), f"scale is {ratio:.4g} times that of the lot"
            )


LOOK = Look(scale_units, ("wrong_range", "wrong_units"), order=70)
