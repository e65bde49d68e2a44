"""MATLAB: a .mat file (version 5) with a structure per unit whose fields are the properties of accelparams."""

import io
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from inertial.arrays import Array
from pipelines.export.omissions import ACROSS_T, SCALE, comment_lines
from pipelines.export.polynomials import UnitCalibration, refuse_equal_names
from pipelines.export.settings import ExportSettings
from schemas.units import MICRO, STANDARD_GRAVITY_M_S2

SUFFIX = ".mat"

_LONGEST_NAME = 31  # of a field that every version reads
_HEADER = 116  # bytes of free text at the beginning of a file
_PERCENT = 100.0


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> bytes:
    """The file: one structure per unit, and ``tumbleline`` with run, certificates and what accelparams does not hold.

    ``NoiseDensity`` is N (``NoiseType`` double-sided), vectors are rows, in m/s² with a nominal scale: the output divided by
    ``--set nominal=N``, or by the unit's own mean scale where it is not given.

    Raises
    ------
    WrongUse
        Two units have one name in MATLAB.
    """
    from scipy.io import savemat  # a third of a second

    names = [_variable(unit.unit) for unit in units]
    refuse_equal_names(units, names, "MATLAB")
    content: dict[str, Any] = {name: _properties(unit, settings) for name, unit in zip(names, units, strict=True)}
    content["tumbleline"] = {
        "run": run,
        "units": np.array([unit.unit for unit in units], dtype=object),
        "certificates": np.array([unit.certified for unit in units], dtype=object),
        "remarks": np.array(["; ".join(_remarks(unit, settings)) for unit in units], dtype=object),
        "NoiseType": "double-sided",
    }
    sink = io.BytesIO()
    savemat(sink, content, oned_as="row")
    title = f"MATLAB 5.0 MAT-file, accelerometer calibrations, run {run}".encode("ascii", "replace")
    return title[:_HEADER].ljust(_HEADER) + sink.getvalue()[_HEADER:]  # the library writes the time of day there


def _properties(unit: UnitCalibration, settings: ExportSettings) -> dict[str, Any]:
    """The properties of accelparams in m/s², %, °C."""
    nominal, g = _nominal(unit, settings), STANDARD_GRAVITY_M_S2
    scales = np.diag(unit.response[0])
    noise = {} if unit.noise is None else {s: g / MICRO * unit.noise.value[s][None, :] for s in ("N", "B", "K")}
    skew = _PERCENT * unit.response[0] / scales[:, None]
    content: dict[str, Any] = {
        "ConstantBias": (g * unit.bias[0] / nominal)[None, :],
        "AxesMisalignment": skew,
        "TemperatureBias": (g * _temperature_bias(unit) / nominal)[None, :],
        "TemperatureScaleFactor": (_PERCENT * np.diag(unit.response[1]) / scales)[None, :],
    }
    if unit.full_scale is not None:
        content["MeasurementRange"] = g * unit.full_scale / nominal
    if unit.out_unit == "LSB":
        content["Resolution"] = g / nominal
    names = {"N": "NoiseDensity", "B": "BiasInstability", "K": "RandomWalk"}
    return content | {names[s]: values for s, values in noise.items() if np.all(np.isfinite(values))}


def _temperature_bias(unit: UnitCalibration) -> Array:
    """Change of the bias (3,) per K before MATLAB's scale over temperature, which multiplies the constant bias too."""
    return unit.bias[1] - unit.bias[0] * np.diag(unit.response[1]) / np.diag(unit.response[0])


def _nominal(unit: UnitCalibration, settings: ExportSettings) -> float:
    return settings.nominal or float(np.mean(np.diag(unit.response[0])))


def _remarks(unit: UnitCalibration, settings: ExportSettings) -> list[str]:
    nominal = _nominal(unit, settings)
    m = unit.response[0] / np.diag(unit.response[0])[:, None]

    def applied(output: Array, temperature: float) -> Array:
        """The inverse of accelparams' sensor: misalignment, biases, then the scale over temperature."""
        theta = temperature - 25.0
        ratio = np.diag(unit.response[1]) / np.diag(unit.response[0])
        before = output / nominal / (1.0 + theta * ratio)
        return np.linalg.solve(m, (before - (unit.bias[0] + theta * _temperature_bias(unit)) / nominal).T).T

    low, high = unit.temperatures
    return [
        f"{low:.1f} to {high:.1f} °C",
        "MATLAB's output: (AxesMisalignment/100·a + ConstantBias + ΔT·TemperatureBias)·(1 + ΔT/100·TemperatureScaleFactor)",
        f"nominal scale {nominal:g} {unit.out_unit}/g",
        *comment_lines(unit, applied, (SCALE, ACROSS_T), nominal),
    ]


def _variable(unit: str) -> str:
    name = re.sub(r"\W", "_", unit, flags=re.ASCII)
    return (name if name[:1].isalpha() else f"unit_{name}")[:_LONGEST_NAME]
