"""Betaflight: the line ``set acc_calibration`` of one unit; offsets only, in whole counts."""

from collections.abc import Sequence

import numpy as np

from inertial.arrays import Array
from pipelines.export.omissions import (
    ACROSS,
    ACROSS_T,
    BIAS_T,
    SCALE,
    SCALE_T,
    comment,
    comment_lines,
)
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.settings import ExportSettings

SUFFIX = ".txt"
ONE_UNIT = True


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The line of a unit as text: x,y,z in counts of acc_1G, subtracted after the alignment, and 1 for calibrated.

    Raises
    ------
    WrongUse
        The nominal output is missing.
    """
    unit, counts = units[0], settings.counts_per_g
    nominal = settings.nominal_for(unit, "Betaflight")
    offsets = np.rint(unit.bias[0] / nominal * counts)

    def applied(output: Array, temperature: float) -> Array:
        return (output / nominal * counts - offsets) / counts

    low, high = unit.temperatures
    lines = [
        f"accelerometer calibration of unit {unit.unit}, run {run}, offsets at 25 °C, measured from {low:.1f} to {high:.1f} °C",
        unit.certified,
        f"assumed: {counts} counts for 1 g (acc_1G), output of the driver for 1 g {nominal:g} {unit.out_unit}",
        f"not in this file: fractions of a count, up to {0.5e6 / counts:.3g} µg",
        *comment_lines(unit, applied, (SCALE, SCALE_T, BIAS_T, ACROSS, ACROSS_T), nominal),
    ]
    values = ",".join(f"{value:.0f}" for value in offsets + 0.0)
    return "\n".join([*(f"# {comment(line)}" for line in lines), f"set acc_calibration = {values},1", "save"]) + "\n"
