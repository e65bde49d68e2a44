"""Parameters of autopilots: an offset in m/s² and a scale per axis, applied as (a − offset)·scale, and its temperature."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from pipelines.export.omissions import ACROSS, ACROSS_T, BIAS_T, SCALE_T, Applied, comment, comment_lines
from pipelines.export.polynomials import UnitCalibration
from schemas.units import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True)
class Offsets:
    """The offsets and scales that an autopilot applies, as its parameters hold them (float32).

    offset : (3,), m/s², at ``at_C``; scale : (3,)
    thermal : (4, 3), m/s² per K^k, coefficients of (T − 25 °C)^k, zero where the format gets no temperature terms
    at_C : °C; offset and thermal together are the bias there
    """

    offset: Array
    scale: Array
    thermal: Array
    at_C: float


def bias_m_s2(unit: UnitCalibration, nominal: float) -> Array:
    """The bias (4, 3) in the driver's m/s² per K^k."""
    return STANDARD_GRAVITY_M_S2 * unit.bias / nominal


def scales(unit: UnitCalibration, nominal: float) -> Array:
    """The scale (3,) that the autopilot multiplies by."""
    return nominal / np.diag(unit.response[0])


def number(value: float) -> str:
    """A number as float32, with the fewest digits that identify it."""
    return np.format_float_positional(np.float32(value), unique=True, trim="0")


def rounded(values: Array) -> Array:
    """Values (...) as float32 holds them."""
    return values.astype(np.float32).astype(np.float64)


def heading(
    unit: UnitCalibration, run: str, nominal: float, applied: Applied, *, thermal: bool, where: str
) -> list[str]:
    """Comment lines of a unit's file: its purpose, its certificate, and the terms that it does not hold, µg."""
    low, high = unit.temperatures
    parts: Sequence[str] = (ACROSS, ACROSS_T, SCALE_T) if thermal else (ACROSS, ACROSS_T, SCALE_T, BIAS_T)
    lines = [
        f"accelerometer calibration of unit {unit.unit}, run {run}, {low:.1f} to {high:.1f} °C",
        unit.certified,
        f"{where}; assumed output of the driver for 1 g: {nominal:g} {unit.out_unit}",
        *comment_lines(unit, applied, parts),
    ]
    return [f"# {comment(line)}" for line in lines]


def in_g(nominal: float, offsets: Offsets) -> Applied:
    """Specific force in g as the autopilot computes it from outputs (n, 3) at a temperature inside the measured range."""

    def applied(output: Array, temperature: float) -> Array:
        raw = STANDARD_GRAVITY_M_S2 * output / nominal
        thermal = (temperature - 25.0) ** np.arange(len(offsets.thermal)) @ offsets.thermal
        return (raw - thermal - offsets.offset) * offsets.scale / STANDARD_GRAVITY_M_S2

    return applied
