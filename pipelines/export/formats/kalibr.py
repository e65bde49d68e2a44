"""Kalibr: imu.yaml of one unit with noise density and random walk of the accelerometer."""

from collections.abc import Sequence

import numpy as np

from inertial.arrays import Array
from pipelines.export.omissions import largest_error_ug, noise_heading
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.settings import ExportSettings
from pipelines.export.unit_noise import required_noise
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

SUFFIX = ".yaml"
ONE_UNIT = True
COMPLETE = True  # it holds noise alone; the comments name the calibration that is not in it

_KEYS = (("N", "accelerometer_noise_density", "m/s²/√Hz"), ("K", "accelerometer_random_walk", "m/s³/√Hz"))


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The file of a unit as text: the noisiest axis, as Kalibr has one figure for all, with each axis in a comment.

    Kalibr's noise density is N of IEEE Std 952 (two-sided), not the one-sided density of data sheets, which is N·√2.

    Raises
    ------
    WrongUse
        The run has no static record.
    """
    unit = units[0]
    noise = required_noise(unit.noise, unit.unit, run, "format kalibr")
    factor = STANDARD_GRAVITY_M_S2 / MICRO
    rate = settings.rate_hz or noise.rate_hz
    remarks = (
        "as measured at rest; Kalibr's users multiply by 5 to 20 for motion and temperature",
        "add gyroscope_noise_density, gyroscope_random_walk and rostopic: this calibration does not contain them",
    )
    lines = noise_heading(unit, run, noise, [_without_calibration(unit)], remarks)
    for symbol, key, text in _KEYS:
        values = factor * noise.value[symbol]
        by_axis = ", ".join(f"{axis} {value:.4g}" for axis, value in zip(AXES, values, strict=True))
        remark = noise.remark(symbol)
        lines += [f"# {symbol} by axis, {text}: {by_axis}" + (f"; {remark}" if remark else "")]
        lines += [f"{key}: {float(np.max(values)):.6e}"]
    return "\n".join([*lines, f"update_rate: {rate:g}"]) + "\n"


def _without_calibration(unit: UnitCalibration) -> str:
    """Error of the uncorrected output where the driver divides by the unit's own mean scale."""
    scale = float(np.mean(np.diag(unit.response[0])))

    def applied(output: Array, temperature: float) -> Array:
        return output / scale

    size = largest_error_ug(unit, applied)
    return f"not in this file: the calibration itself; without it the output is wrong by up to {size:.3g} µg at 1 g"
