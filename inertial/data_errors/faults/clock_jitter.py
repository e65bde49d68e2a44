"""Time that runs backwards."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def clock(readings: Readings) -> Iterator[Fault]:
    """Time that runs backwards from one dwell to the next."""
    for unit, time in enumerate(readings.time):
        row = readings.there[unit]
        back = np.flatnonzero(np.diff(time[row]) < 0.0)
        if back.size:
            dwells = np.flatnonzero(row)[back + 1]
            step = float(np.diff(time[row])[back[0]])
            yield Fault(
                "clock_jitter",
                unit,
                tuple(dwells.tolist()),
                f"time steps back by {-step:.1f} s at dwell {{dwell[{dwells[0]}]}}",
            )


LOOK = Look(clock, ("clock_jitter",), order=20, order_in_one_pose=20)
