"""A scale unlike that of the lot: another range, or another unit."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def scale_units(readings: Readings) -> Iterator[Fault]:
    """A unit whose scale differs from the scale on which more than half of the units agree.

    Without such a majority the lot has several ranges or sensitivities, and no unit is reported.
    """
    scale = readings.scale
    alone = np.ones(scale.size) if readings.unit_name == "g" else scale
    usual = np.full(scale.size, np.median(scale)) if scale.size > 2 else alone
    ratios = scale / usual
    near = (ratios > 0.75) & (ratios < 1.33)
    if scale.size > 2 and 2 * np.count_nonzero(near) <= scale.size:
        return
    for unit in np.flatnonzero(~near & readings.follows).tolist():
        octaves = np.log2(ratios[unit])
        power_of_two = abs(octaves - round(octaves)) < 0.06 and abs(round(octaves)) <= 4
        evidence = f"scale is {ratios[unit]:.4g} times that of the lot"
        yield Fault("wrong_range" if power_of_two else "wrong_units", unit, (), evidence)


LOOK = Look(scale_units, ("wrong_range", "wrong_units"), order=70)
