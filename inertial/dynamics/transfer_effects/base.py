"""What an effect on a transfer function is, and the conditions of the points of a sweep."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from inertial.arrays import Array, Complex, Flags
from inertial.dynamics.effect_modules import DynamicEffect

AMBIENT_C, AMBIENT_HPA = 25.0, 1013.25
"""To which parameters refer that another effect changes."""


class Parameter(NamedTuple):
    """A parameter of an effect: name, unit, bounds, and the values from which a fit starts.

    ``log`` parameters are positive and are fitted by their logarithm.
    """

    name: str
    unit: str
    low: float
    high: float
    starts: tuple[float, ...]
    log: bool = False


class Coordinates:
    """Parameters (p,) as a search sees them: the logarithm of those that are positive.

    log : (p,), which these are; low, high : (p,), bounds of the coordinates
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.log = np.array([p.log for p in parameters], dtype=bool)
        self.low = self.of(np.array([p.low for p in parameters], dtype=np.float64))
        self.high = self.of(np.array([p.high for p in parameters], dtype=np.float64))

    def of(self, values: Array) -> Array:
        """Coordinates of values."""
        return np.where(self.log, np.log(np.where(self.log, values, 1.0)), values)

    def values(self, coordinates: Array) -> Array:
        """Values at some coordinates."""
        return np.where(self.log, np.exp(np.where(self.log, coordinates, 0.0)), coordinates)


@dataclass(frozen=True)
class Conditions:
    """The points of a sweep, all (n,).

    frequency : Hz · level : peak g · temperature : °C · record_s : duration of the record of a point, s
    pressure_hPa : of the air; None where it was not recorded
    """

    frequency: Array
    level: Array
    temperature: Array
    record_s: Array
    pressure_hPa: Array | None = None

    @property
    def pressure(self) -> Array:
        """Pressure of the air (n,), hPa; the standard one where it was not recorded."""
        known = np.full(len(self.frequency), np.nan) if self.pressure_hPa is None else self.pressure_hPa
        return np.where(np.isnan(known), AMBIENT_HPA, known)

    @property
    def columns(self) -> tuple[Array, ...]:
        """Frequency, level, temperature, duration and pressure."""
        return self.frequency, self.level, self.temperature, self.record_s, self.pressure

    def picked(self, rows: Flags) -> "Conditions":
        """Some of the points."""
        return Conditions(*(column[rows] for column in self.columns))

    def along(self, frequency: Array) -> "Conditions":
        """Other frequencies (m,) in the middle of the conditions of these points."""
        return Conditions(frequency, *(np.full(len(frequency), np.median(column)) for column in self.columns[1:]))


class TransferEffect(DynamicEffect, ABC):
    """A factor of the transfer function, 1 where it does not act; or what changes parameters of others from point to point.

    Every module of this package defines one class.

    in_every_device : a filter that a device has somewhere, if only far beyond the points: what the points say of the sensing
    element must hold beside it, too
    """

    in_every_device: ClassVar[bool] = False

    @abstractmethod
    def parameters(self, points: Conditions) -> tuple[Parameter, ...]:
        """The parameters, with bounds and starts that suit the points."""

    def factor(self, points: Conditions, values: Array) -> Complex:
        """The factor (n,) at the points for parameter values (p,); for values (p, k, 1) or (p, k, n) of k models (k, n)."""
        return np.ones(len(points.frequency), dtype=np.complex128)

    def changes(self, points: Conditions, values: Array) -> Mapping[str, Array]:
        """Factors, as of :meth:`factor`, of parameters of other effects at the points, by their names; none for most effects."""
        return {}

    def seen(self, points: Conditions) -> bool:
        """Whether the points can show the effect at all."""
        return True
