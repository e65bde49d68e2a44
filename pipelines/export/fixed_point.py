"""Calibration in fixed point: a = M(x)·(u − β(x)), u the output over a nominal scale, x = θ/64 K, in units of 2⁻²⁴.

M is a polynomial that was fitted over the measured temperatures alone: beyond them the coefficients of the nearest one hold. An
axis without an output has the force along it in g as its u: its row of M is that of the identity, and its β is 0.
"""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Flags, Index
from pipelines.export.polynomials import ORDER, UnitCalibration
from schemas.errors import WrongUse
from schemas.units import AXES

BITS = 24
ONE = 1 << BITS
TEMPERATURE_SPAN_K = 64.0
_NODES = 33
_LARGEST = 2**31 - 1


@dataclass(frozen=True)
class FixedPoint:
    """Coefficients as 32-bit integers, units of 2⁻²⁴.

    scale : output per g by which the output is divided
    bias : (4, 3), g, of x⁰ … x³; inverse : (4, 3, 3), of x⁰ … x³
    range_mC : lowest and highest temperature that it holds for, thousandths of a degree Celsius
    """

    scale: float
    bias: Index
    inverse: Index
    range_mC: tuple[int, int]

    @property
    def of_forces(self) -> Flags:
        """Axes (3,) without an output: no bias, and the row of the identity at every temperature."""
        plain = np.zeros_like(self.inverse)
        plain[0] = ONE * np.eye(len(AXES), dtype=np.int64)
        return ~np.any(self.bias, axis=0) & np.all(self.inverse == plain, axis=(0, 2))

    def correct(self, output: Array, temperature: float) -> Array:
        """Specific force (n, 3) in g of outputs (n, 3) in the unit of the output, digit by digit as the C code computes it."""
        u = np.rint(output / np.where(self.of_forces, 1.0, self.scale) * ONE).astype(np.int64)
        low, high = self.range_mC
        x = np.int64(_truncated((min(max(round(1000.0 * temperature), low), high) - 25000) * 32768, 125))
        d = u - _horner(self.bias, x)
        return _shifted((_horner(self.inverse, x) * d[:, None, :]).sum(axis=-1)) / ONE


def fixed_point(unit: UnitCalibration) -> FixedPoint:
    """The calibration of a unit in fixed point; K⁻¹ over temperature is a polynomial fitted over the measured range.

    Raises
    ------
    WrongUse
        A coefficient is beyond ±128.
    """
    axes = list(unit.axes)
    full = unit.with_every_axis
    scale = float(np.mean(np.diag(full.response[0])[axes]))
    per_axis = np.ones(len(AXES))
    per_axis[axes] = scale
    span = TEMPERATURE_SPAN_K ** np.arange(ORDER)
    low, high = unit.temperatures
    middle, half = 0.5 * (low + high) - 25.0, 0.5 * (high - low)
    order = ORDER if half > 0.0 and np.any(full.response[1:]) else 1
    theta = middle + half * np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
    response = np.einsum("tk,kij->tij", theta[:, None] ** np.arange(ORDER), full.response) / per_axis[:, None]
    inverse = np.zeros((ORDER, 9))
    powers = (theta[:, None] / TEMPERATURE_SPAN_K) ** np.arange(order)
    inverse[:order] = np.linalg.lstsq(powers, np.linalg.inv(response).reshape(_NODES, 9), rcond=None)[0]
    values = np.rint(full.bias / per_axis * span[:, None] * ONE), np.rint(inverse.reshape(ORDER, 3, 3) * ONE)
    largest = max(float(np.max(np.abs(v))) for v in values)
    if not largest <= _LARGEST:
        raise WrongUse(
            f"export: a coefficient of unit {unit.unit} is {largest / ONE:.4g} in fixed point, ±{_LARGEST / ONE:.0f} is the "
            "range; export with --set arithmetic=float"
        )
    bias, matrix = (v.astype(np.int64) for v in values)
    for axis in set(range(len(AXES))) - set(axes):
        matrix[:, axis] = 0
        matrix[0, axis, axis] = ONE
    return FixedPoint(scale, bias, matrix, thousandths(unit.temperatures))


def thousandths(temperatures: tuple[float, float]) -> tuple[int, int]:
    """A range of temperatures, °C, in thousandths of a degree."""
    low, high = (round(1000.0 * value) for value in temperatures)
    return low, high


def _horner(coefficients: Index, x: np.int64) -> Index:
    value = coefficients[-1]
    for lower in coefficients[-2::-1]:
        value = lower + _shifted(value * x)
    return value


def _shifted(product: Index) -> Index:
    """A product of two numbers in units of 2⁻²⁴, rounded to units of 2⁻²⁴."""
    return (product + (ONE >> 1)) >> BITS


def _truncated(value: int, divisor: int) -> int:
    """Division of integers as C does it, towards zero."""
    return value // divisor if value >= 0 else -(-value // divisor)
