"""The lot: unit-to-unit spread of what every starting model knows, and the outputs' own units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Kind:
    """A kind of device: output unit, sensitivity, and spreads (g, relative, rad, g/K, 1/K); density in g/√Hz, rate in Hz."""

    out_unit: str
    per_g: float
    zero: float
    bias: float
    scale: float
    misalignment: float
    bias_tempco: float
    scale_tempco: float
    density: float
    rate: float


KINDS: dict[str, Kind] = {
    "mems": Kind("g", 1.0, 0.0, 0.030, 0.003, 0.004, 60e-6, 100e-6, 25e-6, 100.0),
    "counts": Kind("LSB", 256000.0, 0.0, 0.040, 0.004, 0.005, 50e-6, 150e-6, 25e-6, 250.0),
    "analogue": Kind("V", 0.3, 1.5, 0.030, 0.006, 0.006, 90e-6, 100e-6, 60e-6, 200.0),
    "servo": Kind("g", 1.0, 0.0, 0.002, 0.0008, 0.0015, 10e-6, 30e-6, 12e-6, 100.0),
}


@dataclass(frozen=True)
class Lot:
    """The units of a run: bias (U, 3) g, matrix (U, 3, 3), tempcos (U, 3), white noise of a sample (U, 3) g."""

    kind: Kind
    names: tuple[str, ...]
    bias: Floats
    matrix: Floats
    bias_tempco: Floats
    scale_tempco: Floats
    sample_noise: Floats

    @staticmethod
    def draw(rng: np.random.Generator, kind_name: str, units: int) -> Lot:
        """A lot of `units` devices of the kind."""
        kind = KINDS[kind_name]
        first = int(rng.integers(100, 900))
        names = tuple(f"U{first + k:04d}" for k in range(units))
        mean = rng.standard_normal(3)
        turn = kind.misalignment * rng.standard_normal((units, 3, 3))
        turn[:, range(3), range(3)] = kind.scale * (rng.standard_normal(3) + 0.7 * rng.standard_normal((units, 3)))
        density = kind.density * 10.0 ** rng.uniform(-0.3, 0.2)
        spread = 1.0 + 0.1 * rng.standard_normal((units, 3))
        return Lot(
            kind,
            names,
            kind.bias * (0.5 * mean + rng.standard_normal((units, 3))),
            np.eye(3) + turn,
            kind.bias_tempco * (mean + 0.5 * rng.standard_normal((units, 3))),
            kind.scale_tempco * (1.0 + 0.5 * rng.standard_normal((units, 3))),
            density * np.sqrt(kind.rate / 2.0) * spread.clip(0.7, 1.3),
        )

    def axes(self) -> Floats:
        """The matrix with its rows of unit length on the diagonal: where each sensing axis points, (U, 3, 3)."""
        turn = self.matrix.copy()
        turn[:, range(3), range(3)] = 1.0
        return turn

    def gain(self) -> Floats:
        """Scale factor of each axis, (U, 3)."""
        return np.diagonal(self.matrix, axis1=1, axis2=2)
