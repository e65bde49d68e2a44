"""PX4: CAL_ACC and TC_A parameters of one unit, in QGroundControl's columns (vehicle, component, name, value, type)."""

from collections.abc import Sequence

import numpy as np

from pipelines.export.parameters import Offsets, bias_m_s2, heading, in_g, number, rounded, scales
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.settings import ExportSettings
from schemas.errors import WrongUse

SUFFIX = ".params"
ONE_UNIT = True

_INT32, _REAL32 = 6, 9  # MAV_PARAM_TYPE
_PRIORITY = 50
_REFERENCE_C = 25.0


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The parameters of a unit as text.

    PX4 applies (raw − thermal − OFF)·SCALE, with thermal = x3·d³ + x2·d² + x1·d + x0, d = T − TREF: the bias at 25 °C is in OFF
    and X0 is zero, so that it is subtracted once.

    Raises
    ------
    WrongUse
        The nominal output or the device's id is missing: PX4 ignores a calibration whose id is not the sensor's.
    """
    unit = units[0]
    nominal = settings.nominal_for(unit, "autopilot parameters")
    if unit.unit not in settings.device_ids:
        raise WrongUse(
            f"export: no device id of unit {unit.unit}, PX4 applies a calibration only where CAL_ACC{settings.sensor}_ID is the "
            f"id of its sensor; read the parameter in QGroundControl and give it with --set device_id={unit.unit}=ID"
        )
    device, n = settings.device_ids[unit.unit], settings.sensor
    bias = bias_m_s2(unit, nominal)
    thermal = np.vstack([np.zeros(3), bias[1:]])
    offsets = Offsets(rounded(bias[0]), rounded(scales(unit, nominal)), rounded(thermal), _REFERENCE_C)
    where = f"accelerometer {n} of PX4, device id {device}"
    lines = heading(unit, run, nominal, in_g(nominal, offsets), thermal=True, where=where)
    lines.append("# Vehicle-Id\tComponent-Id\tName\tValue\tType")
    rows: list[tuple[str, float, int]] = [
        (f"CAL_ACC{n}_ID", device, _INT32),
        (f"CAL_ACC{n}_PRIO", _PRIORITY, _INT32),
        *((f"CAL_ACC{n}_{axis}OFF", offsets.offset[i], _REAL32) for i, axis in enumerate("XYZ")),
        *((f"CAL_ACC{n}_{axis}SCALE", offsets.scale[i], _REAL32) for i, axis in enumerate("XYZ")),
    ]
    if np.any(offsets.thermal):
        low, high = unit.temperatures
        rows += [
            ("TC_A_ENABLE", 1, _INT32),
            (f"TC_A{n}_ID", device, _INT32),
            (f"TC_A{n}_TREF", _REFERENCE_C, _REAL32),
            (f"TC_A{n}_TMIN", low, _REAL32),
            (f"TC_A{n}_TMAX", high, _REAL32),
            *((f"TC_A{n}_X{k}_{i}", offsets.thermal[k, i], _REAL32) for k in (3, 2, 1, 0) for i in range(3)),
        ]
    lines += [f"1\t1\t{name}\t{value if kind == _INT32 else number(value)}\t{kind}" for name, value, kind in rows]
    return "\n".join(lines) + "\n"
