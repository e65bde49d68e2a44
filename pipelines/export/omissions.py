"""Terms that a format cannot hold, each with the error of the corrected output, µg, at 1 g over the measured temperatures."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from inertial.arrays import Array
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.unit_noise import UnitNoise
from schemas.units import MICRO

Applied = Callable[[Array, float], Array]

TEMPERATURES = 33  # what is left of a fitted cubic has its largest values between the ends
LEAST_UG = 1e-3
_CUBE = np.array([corner for corner in product((-1.0, 0.0, 1.0), repeat=3) if any(corner)])
DIRECTIONS = _CUBE / np.linalg.norm(_CUBE, axis=1)[:, None]
"""The 26 directions (26, 3) of faces, edges and corners of a cube: specific forces of 1 g."""

BIAS, BIAS_T = "bias", "temperature dependence of the bias"
SCALE, SCALE_T = "scale", "temperature dependence of the scale"
ACROSS, ACROSS_T = "misalignment", "temperature dependence of the misalignment"


def outputs(unit: UnitCalibration, temperature: float, size_g: float = 1.0) -> Array:
    """Output (26, 3) of the unit by its full calibration, under a force of this size in :data:`DIRECTIONS`."""
    powers = (temperature - 25.0) ** np.arange(len(unit.bias))
    force = size_g * DIRECTIONS
    return np.einsum("k,ki->i", powers, unit.bias) + force @ np.einsum("k,kij->ij", powers, unit.response).T


def largest_error_ug(unit: UnitCalibration, applied: Applied, size_g: float = 1.0) -> float:
    """Largest error of an axis, µg, of ``applied(output (n, 3), temperature)`` in g against the full calibration.

    Parameters
    ----------
    size_g : of the force; over the measured temperatures
    """
    grid = np.linspace(*unit.temperatures, TEMPERATURES)
    errors = (applied(outputs(unit, t, size_g), t) - size_g * DIRECTIONS for t in grid)
    return max(float(np.abs(error).max()) for error in errors) * MICRO


def omitted(unit: UnitCalibration, parts: Sequence[str], nominal: float = 0.0) -> list[tuple[str, float]]:
    """Each part that a format does not hold and the error without it, µg; only those that the calibration has."""
    sizes = [(part, largest_error_ug(unit, _without(unit, part, nominal).correct)) for part in parts]
    return [(part, size) for part, size in sizes if size >= LEAST_UG]


def _without(unit: UnitCalibration, part: str, nominal: float) -> UnitCalibration:
    bias, response = unit.bias.copy(), unit.response[0].copy()
    # S(θ)·M, and what of the axes turns with temperature besides
    gains = np.diagonal(unit.response[1:], axis1=1, axis2=2) / np.diag(response)
    turned = unit.response[1:] - gains[..., None] * response
    if part == BIAS:
        bias[0] = 0.0
    elif part == BIAS_T:
        bias[1:] = 0.0
    elif part == SCALE:
        response += np.diag((nominal or float(np.mean(np.diag(response)))) - np.diag(response))
    elif part == SCALE_T:
        gains = np.zeros_like(gains)
    elif part == ACROSS:
        response *= np.eye(3)
    else:
        turned = np.zeros_like(turned)
    return replace(unit, bias=bias, response=np.concatenate([response[None], gains[..., None] * response + turned]))


def comment(text: str) -> str:
    """Text that cannot end a C comment or a line."""
    return " ".join(text.replace("*/", "* /").split())


def noise_heading(
    unit: UnitCalibration, run: str, noise: UnitNoise, before: Sequence[str], after: Sequence[str]
) -> list[str]:
    """Comment lines of a file that holds the noise of a unit alone: what it is, its certificate, and what it does not hold.

    Parameters
    ----------
    before, after : further lines, before and after that of the effects that the file does not hold
    """
    left_out = [f"not in this file: effects {', '.join(unit.left_out)}"] if unit.left_out else []
    head = f"noise of accelerometer {unit.unit}, run {run}, static record at {noise.rate_hz:g} Hz"
    return [f"# {comment(line)}" for line in (head, unit.certified, *before, *left_out, *after)]


def comment_lines(unit: UnitCalibration, applied: Applied, parts: Sequence[str], nominal: float = 0.0) -> list[str]:
    """Lines of a comment: the parts of a calibration that a file does not hold, and the remaining error, µg."""
    lines = [f"not in this file: {part}, up to {size:.3g} µg" for part, size in omitted(unit, parts, nominal)]
    total = largest_error_ug(unit, applied)
    return [*lines, f"largest error of this file against the full calibration, at 1 g: {total:.3g} µg"]
