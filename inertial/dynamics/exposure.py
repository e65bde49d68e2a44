"""What an exposure changed for good: the shift of bias and scale between the same poses before and after it."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from inertial.arrays import Array, Flags
from inertial.dynamics.stability import ShortNoise, difference_variance
from inertial.dynamics.wander import stated_error
from inertial.errors import NotIdentified

FEWEST_LEFT = 4
"""Degrees of freedom that the repeated poses must leave."""
APART_K = 1.0
"""Between the temperature of the test and others that show the change with temperature."""


@dataclass(frozen=True)
class Shift:
    """A change with its standard uncertainty, half of whose U (k = 2) has 95 %; in the unit of the output, or of output per g."""

    value: float
    u: float


@dataclass(frozen=True)
class ExposureShift:
    """Change of bias and of the response along the axis; ``left`` (n,) is what the model of all records leaves."""

    bias: Shift
    scale: Shift
    left: Array


@dataclass(frozen=True)
class TemperatureSlope:
    """Change of bias and of the response to the three forces with temperature, (4,), and its standard error, per K."""

    value: Array
    u: Array


def temperature_slope(force: Array, output: Array, temperature: Array, at_C: float) -> TemperatureSlope:
    """Slope at a temperature of a bias and a response to the three forces that are of second order in temperature.

    The error is that of the least squares, whose scatter holds what is not of second order, and hysteresis.

    Parameters
    ----------
    force, output, temperature : (n, 3) in g, (n,) and (n,), °C, of records in six poses at three temperatures or more
    at_C : the temperature of the slope

    Raises
    ------
    NotIdentified
        A temperature is missing, or the records do not tell the slope of the bias from that of the response.
    """
    if not np.isfinite([at_C, *temperature]).all():
        raise NotIdentified("the unit's temperature is not recorded")
    columns, theta = np.column_stack([np.ones(len(force)), force]), temperature - at_C
    groups = theta < -APART_K, np.abs(theta) <= APART_K, theta > APART_K
    rows = np.hstack([columns * theta[:, None] ** power for power in range(3)])
    dof = len(rows) - rows.shape[1]
    if dof < FEWEST_LEFT or any(np.linalg.matrix_rank(columns[group]) < columns.shape[1] for group in groups):
        raise NotIdentified(
            f"six poses are needed at the temperature of the test ({at_C:.3g} °C), and more than {APART_K:g} K below and above it"
        )
    inverse = np.linalg.inv(rows.T @ rows)
    fitted = inverse @ rows.T @ output
    left = output - rows @ fitted
    return TemperatureSlope(fitted[4:8], np.sqrt(float(left @ left) / dof * np.diagonal(inverse))[4:8])


def exposure_shift(
    force: Array, output: Array, after: Flags, axis: int, noise: ShortNoise, window_s: float, apart_s: float
) -> ExposureShift:
    """Least squares of a bias and a response to the three forces before, and of the change of each after an exposure.

    Poses must come at least twice in each of the two groups: their scatter is the uncertainty of the means. Beside it the bias
    has wandered by 1/f noise between the groups, which no scatter inside them shows.

    Parameters
    ----------
    force, output, after : (n, 3) in g, (n,) and (n,) of the records
    noise : of one record, unit of the output
    window_s, apart_s : duration of a group, and between the middles of both

    Raises
    ------
    NotIdentified
        Too few records, or poses that do not tell bias from response.
    """
    columns = np.column_stack([np.ones(len(force)), force])
    rows = np.hstack([columns, columns * after[:, None]])
    dof = len(rows) - rows.shape[1]
    if dof < FEWEST_LEFT or np.linalg.matrix_rank(rows) < rows.shape[1]:
        raise NotIdentified(
            f"exposure: {len(rows)} records for {rows.shape[1]} unknowns, {rows.shape[1] + FEWEST_LEFT} in six poses are needed; "
            "raise repeats"
        )
    inverse = np.linalg.inv(rows.T @ rows)
    fitted = inverse @ rows.T @ output
    left = output - rows @ fitted
    spread = np.sqrt(float(left @ left) / dof * np.diagonal(inverse)) * float(t.ppf(0.975, dof) / norm.ppf(0.975))
    slope = difference_variance(window_s, apart_s)
    wandered = stated_error(noise.flicker * slope, slope, noise.flicker_error)
    bias, scale = 4, 5 + axis
    return ExposureShift(
        Shift(float(fitted[bias]), float(np.hypot(spread[bias], wandered))),
        Shift(float(fitted[scale]), float(spread[scale])),
        left,
    )
