"""Temperatures in a unit other than °C."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Readings

_WARM = 10.0  # K, change of the lot's temperature from which on thermometers are compared
_STEEP = (0.75, 1.33)  # change of a thermometer over that of the lot; one in °F has 1.8, raw counts have any
_TOGETHER = 0.998  # squared correlation with the lot, below which a unit has temperatures of its own, as one not soaked


def temperature_units(readings: Readings) -> Iterator[Fault]:
    """Temperatures that cannot be °C, or that follow those of the other units in another unit of measure."""
    rows = readings.temperature if readings.temperature is not None else np.empty((0, 0))
    usual = np.nanmedian(rows, axis=0) if len(rows) > 2 else np.full(rows.shape[1], np.nan)
    for unit, row in enumerate(rows):
        typical, both = float(np.nanmedian(row)), np.isfinite(row) & np.isfinite(usual)
        if typical > 200.0 or typical < -100.0:
            yield Fault("wrong_units", unit, (), f"temperature about {typical:.0f}, not °C")
        elif np.count_nonzero(both) > 2 and np.ptp(usual[both]) > _WARM:
            (of_unit, shared), (_, of_lot) = np.cov(row[both], usual[both])
            steep = float(np.sqrt(of_unit / of_lot))
            if shared**2 > _TOGETHER * of_unit * of_lot and not _STEEP[0] < steep < _STEEP[1]:
                evidence = f"temperature changes by {steep:.3g} times that of the lot; a thermometer in °F by 1.8 times"
                yield Fault("wrong_units", unit, (), evidence)


LOOK = Look(temperature_units, ("wrong_units",), order=30, order_in_one_pose=30)
