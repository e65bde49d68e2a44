"""ROS: parameters of the noise of one unit for nodes and simulators, and the covariance for sensor_msgs/Imu."""

from collections.abc import Sequence

import numpy as np

from inertial.noise.gauss_markov import flicker_terms
from pipelines.export.omissions import noise_heading
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.settings import ExportSettings
from pipelines.export.unit_noise import required_noise
from schemas.units import MICRO, STANDARD_GRAVITY_M_S2

SUFFIX = ".yaml"
ONE_UNIT = True
COMPLETE = True  # it holds noise alone

_SHORTEST_S, _LONGEST_S = 1.0, 1000.0


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The parameters of a unit as text, lists in the order x, y, z.

    ``bias_correlation_times`` and ``bias_sigmas`` are the Gauss–Markov processes that stand for B: one process alone cannot, as
    its Allan deviation has a maximum where flicker noise is flat.

    Raises
    ------
    WrongUse
        The run has no static record.
    """
    unit = units[0]
    noise = required_noise(unit.noise, unit.unit, run, "format ros")
    factor = STANDARD_GRAVITY_M_S2 / MICRO
    rate = settings.rate_hz or noise.rate_hz
    density, walk, flicker = (factor * noise.value[symbol] for symbol in ("N", "K", "B"))
    terms = flicker_terms(_SHORTEST_S, _LONGEST_S)
    covariance = np.diag(density**2 * rate).ravel()
    remarks = [f"{symbol}: {remark}" for symbol in ("N", "B", "K") if (remark := noise.remark(symbol))]
    meanings = (
        "noise_density is N of IEEE Std 952 (two-sided), m/s²/√Hz; imu_utils' acc_n is another quantity",
        "random_walk: m/s³/√Hz; sigmas: m/s²; times: s; covariance: white noise at update_rate, (m/s²)², row by row",
        f"bias processes: flat to {100.0 * terms.flatness:.2g} % from {_SHORTEST_S:g} to {_LONGEST_S:g} s",
        "not in this file: the calibration itself, and the change of the bias from one switch-on to the next",
    )
    lines = [
        *noise_heading(unit, run, noise, meanings, remarks),
        "/**:",
        "  ros__parameters:",
        f"    update_rate: {rate!r}",
        f"    accelerometer_noise_density: {_list(density)}",
        f"    accelerometer_random_walk: {_list(walk)}",
    ]
    if np.all(np.isfinite(flicker)):
        lines.append(f"    accelerometer_bias_correlation_times: {_list(terms.correlation_s)}")
        lines += [
            f"    accelerometer_bias_sigmas_{axis}: {_list(b * terms.sd)}"
            for axis, b in zip("xyz", flicker, strict=True)
        ]
    return "\n".join([*lines, f"    linear_acceleration_covariance: {_list(covariance)}"]) + "\n"


def _list(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.6e}" for value in values) + "]"
