"""ArduPilot: parameters INS_ACCOFFS, INS_ACCSCAL and INS_TCAL of one unit, as name,value lines."""

from collections.abc import Sequence

import numpy as np

from inertial.arrays import Array
from pipelines.export.parameters import Offsets, bias_m_s2, heading, in_g, number, rounded, scales
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.settings import ExportSettings

SUFFIX = ".param"
ONE_UNIT = True

_SHIFT_C = 10.0  # ArduPilot's polynomials are in T − 35 °C
_LEAST_RANGE_K = 10.0  # between TMIN and TMAX


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The parameters of a unit as text.

    ArduPilot applies (raw − P(T − 35) + P(T_cal − 35) − ACCOFFS)·ACCSCAL with P(x) = 10⁻⁶(c₁x + c₂x² + c₃x³), T and T_cal clipped
    to TMIN … TMAX, which have to be 10 K apart.

    Raises
    ------
    WrongUse
        The nominal output is missing.
    """
    unit = units[0]
    nominal = settings.nominal_for(unit, "autopilot parameters")
    bias, (low, high) = bias_m_s2(unit, nominal), unit.temperatures
    has_thermal = bool(np.any(bias[1:])) and high - low >= _LEAST_RANGE_K
    at = float(np.clip(25.0, low, high)) if has_thermal else 25.0
    polynomial = rounded(_about_35(bias)) if has_thermal else np.zeros((3, 3))
    offsets = Offsets(
        rounded((at - 25.0) ** np.arange(4) @ bias if has_thermal else bias[0]),
        rounded(scales(unit, nominal)),
        _about_25(polynomial, at),
        at,
    )
    n = settings.sensor + 1
    middle = "" if n == 1 else str(n)
    device = settings.device_ids.get(unit.unit)
    unset = f"; INS_ACC{middle}_ID is not set here: calibrate once by its menu"
    where = f"accelerometer {n} of ArduPilot{unset if device is None else f', device id {device}'}"
    lines = heading(unit, run, nominal, in_g(nominal, offsets), thermal=has_thermal, where=where)
    rows: list[tuple[str, str]] = [] if device is None else [(f"INS_ACC{middle}_ID", str(device))]
    rows += [(f"INS_ACC{middle}OFFS_{axis}", number(offsets.offset[i])) for i, axis in enumerate("XYZ")]
    rows += [(f"INS_ACC{middle}SCAL_{axis}", number(offsets.scale[i])) for i, axis in enumerate("XYZ")]
    if has_thermal:
        rows += [
            (f"INS_ACC{n}_CALTEMP", number(at)),
            (f"INS_TCAL{n}_ENABLE", "1"),
            (f"INS_TCAL{n}_TMIN", number(low)),
            (f"INS_TCAL{n}_TMAX", number(high)),
        ]
        rows += [(f"INS_TCAL{n}_ACC{k + 1}_{'XYZ'[i]}", number(value)) for (k, i), value in np.ndenumerate(polynomial)]
    return "\n".join([*lines, *(f"{name},{value}" for name, value in rows)]) + "\n"


def _about_35(bias: Array) -> Array:
    """c₁, c₂, c₃ (3, 3) of (T − 35 °C) in 10⁻⁶ m/s² from the coefficients (4, 3) of (T − 25 °C): θ = x + 10."""
    b1, b2, b3 = bias[1:]
    s = _SHIFT_C
    return 1e6 * np.stack([b1 + 2.0 * s * b2 + 3.0 * s**2 * b3, b2 + 3.0 * s * b3, b3])


def _about_25(polynomial: Array, at: float) -> Array:
    """P(T − 35) − P(T_cal − 35) as coefficients (4, 3) of (T − 25 °C)^k, m/s²."""
    c1, c2, c3 = 1e-6 * polynomial
    s = _SHIFT_C
    terms = np.stack([np.zeros(3), c1 - 2.0 * s * c2 + 3.0 * s**2 * c3, c2 - 3.0 * s * c3, c3])
    terms[0] = -((at - 25.0) ** np.arange(1, 4) @ terms[1:])
    return terms
