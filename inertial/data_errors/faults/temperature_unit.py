"""Temperatures in a unit other than °C."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings


def temperature_units(readings: Readings) -> Iterator[Fault]:
    """Temperatures that cannot be °C."""
    for unit, row in enumerate(readings.temperature if readings.temperature is not None else ()):
        typical = float(np.nanmedian(row))
        if typical > 200.0 or typical < -100.0:
            yield Fault("wrong_units", unit, (), f"temperature about {typical:.0f}, not °C")


LOOK = Look(temperature_units, ("wrong_units",), order=30, order_in_one_pose=30)
