"""Handling errors that look like effects: a unit that moved, a wrong pose, a thermometer with an offset in one soak.

Such alternatives have one to three coefficients and take part in the same search as the effects, which have a coefficient for
every unit and axis. Their scope is "data": no model is extended by them.
"""

from abc import abstractmethod
from dataclasses import replace
from typing import ClassVar, Literal, Protocol

import numpy as np

from inertial.arrays import Array, Places
from inertial.design import of_axes
from inertial.effects.base import Effect
from inertial.estimation.lot import Lot
from inertial.state import State


class Misfit(Protocol):
    """Misfit of the model on a lot that holds only some units, given by their indices in the complete lot."""

    def __call__(self, lot: "Lot", units: tuple[int, ...], *, own_noise: bool = False) -> float:
        """The whitened sum of squares; with ``own_noise`` the deviance at the noise estimated from that lot."""
        ...


_LOCATIONS = 40
EDGE = 3  # dwells at each end of the run within which no change can be detected
_SOAK_APART = 3.0  # difference of temperature, K, above which a dwell begins another soak


class Handling(Effect):
    """A handling error.

    fewest_units : number of units below which it cannot be separated from effects of the sensor and is not searched
    of_one_axis : whether it changes the bias of a single axis of a single unit, given by ``unit`` and ``axis``
    several : whether an axis may have several of them, each starting at a ``dwell``; they are searched together
    in_part : whether a sample of units suffices to find and correct it in a large lot, because it is the same for all units
    of_one : factor by which the coefficient may differ from one before another cause is assumed; infinite: any coefficient
    """

    scope: ClassVar[Literal["sensor", "station", "slot", "data"]] = "data"  # pyright: ignore[reportIncompatibleVariableOverride]
    source: ClassVar[str] = "benchmarks/worlds"
    typical_ug: ClassVar[tuple[float, float]] = (0.0, float("inf"))
    simplicity: ClassVar[int] = 0
    fewest_units: ClassVar[int] = 2
    in_part: ClassVar[bool] = True
    of_one_axis: ClassVar[bool] = False
    several: ClassVar[bool] = False
    of_one: ClassVar[float] = float("inf")

    @abstractmethod
    def locations(self, lot: "Lot") -> list[dict[str, float]]:
        """The locations to search: values of ``unit``, ``other``, ``dwell``, ``soak`` or ``pose``; units in order."""

    def looks(self, lot: "Lot", locations: int) -> int:
        """Number of locations that the price counts: those searched, or all from which the residuals preselected them."""
        return locations

    @abstractmethod
    def change(self, lot: "Lot", slope: Array | None, **location: float) -> Array:
        """Columns of the affected units, (units or 1, n, 3, k), g per unit of the coefficient."""

    def of_each_unit(self, lot: "Lot", slope: Array | None, **location: float) -> Array:
        """Columns (units or 1, n, 3, k), g, with each unit in turn as the affected one; ``location`` has no ``unit``."""
        units = range(lot.state.time.shape[0])
        return np.concatenate([self.change(lot, slope, unit=float(unit), **location) for unit in units])

    @abstractmethod
    def describe(self, lot: "Lot", size: Array, **location: float) -> str:
        """The description for people; ``size`` (k,) are the coefficients."""

    def instead(self, lot: "Lot", **location: float) -> list[dict[str, float]]:
        """Other locations that may explain the same dwells equally well."""
        return []

    def short(self, size: Array, **location: float) -> str:
        """A short text for a location of :meth:`instead`; required where :meth:`instead` returns any."""
        raise NotImplementedError(
            f"{self.id}: 'instead' gives other locations, but 'short' has no text for them; write it"
        )

    def possible(self, size: Array) -> bool:
        """Whether the coefficients (k,) are physically possible; if not, another cause with the same columns is assumed."""
        return bool(np.isinf(self.of_one) or 1.0 / self.of_one < size[0] < self.of_one)

    def near(self, lot: "Lot", **location: float) -> list[dict[str, float]]:
        """The location, and those between it and the adjacent ones of :meth:`locations`."""
        if "dwell" not in location:
            return [location]
        n, step = lot.state.time.shape[1], stride(lot)
        low, high = max(1, int(location["dwell"]) - step + 1), min(n - 1, int(location["dwell"]) + step - 1)
        return [{**location, "dwell": float(k)} for k in range(low, high + 1)]

    def placed(self, lot: "Lot", **location: float) -> dict[str, float]:
        """The location in ``lot``, which includes the dwells that the search left out."""
        return location

    def mended(self, lot: "Lot", size: Array, **location: float) -> "Lot | None":
        """The lot with the error corrected; None if only its term in the model removes it."""
        return None

    def settled(self, lot: "Lot", size: Array, misfit: Misfit, **location: float) -> "Lot | None":
        """The result of :meth:`mended` where the correction needs a further fit; ``misfit``: misfit of a corrected lot."""
        return self.mended(lot, size, **location)

    def dwells(self, lot: "Lot", **location: float) -> list[int]:
        """Indices of the affected dwells: the first after a change, or every wrong dwell."""
        return [int(location["dwell"])] if "dwell" in location else []

    def units(self, **location: float) -> tuple[int, ...]:
        """Indices of the affected units; empty if all units are affected."""
        return tuple(int(location[name]) for name in ("unit", "other") if name in location)

    def columns(self, lot: "Lot", slope: Array | None, **location: float) -> Array:
        """Columns of all blocks, (blocks, n, k), g per unit of the coefficient; zero in unaffected units."""
        change = of_outputs(lot, self.change(lot, slope, **location))
        units, n = lot.state.time.shape
        changes = np.zeros((units, n, len(lot.state.axes), change.shape[-1]))
        if "unit" in location:
            changes[int(location["unit"])] = change[0]
        else:
            changes[:] = change
        return by_block(changes)


class OfOneDwell(Handling):
    """A handling error of a single dwell, ``at``: all dwells are searched in one pass, and a dwell that is found is left out."""

    @abstractmethod
    def every_dwell(self, lot: "Lot") -> Array:
        """Columns (units or 1, n, 3, k), g per unit of the coefficient, of an error in each of the n dwells."""

    def change(self, lot: "Lot", slope: Array | None, **location: float) -> Array:
        """The error in its dwell alone."""
        here = np.arange(lot.state.time.shape[1]) == int(location["at"])
        return self.every_dwell(lot) * here[:, None, None]

    def dwells(self, lot: "Lot", **location: float) -> list[int]:
        """The dwell."""
        return [int(location["at"])]

    def mended(self, lot: "Lot", size: Array, **location: float) -> "Lot | None":
        """The lot without the dwell."""
        return without(lot, self.dwells(lot, **location))


def of_outputs(lot: "Lot", change: Array) -> Array:
    """Changes (units or 1, n, m, k) on the m measured axes, from changes (units or 1, n, 3 or m, k) of force or output."""
    return change if change.shape[2] == len(lot.state.axes) else of_axes(change, lot.state.axes, 2)


def by_block(change: Array) -> Array:
    """Columns (units, n, m, k) rearranged by block, (m·units, n, k)."""
    units, n, m, k = change.shape
    return np.swapaxes(change, 1, 2).reshape(m * units, n, k)


def stride(lot: "Lot") -> int:
    """Distance in dwells of the locations of the first search for a change."""
    return max(1, int(np.ceil(lot.state.time.shape[1] / _LOCATIONS)))


def times(lot: "Lot") -> list[int]:
    """Dwells from which on a change is possible, without the ends."""
    n = lot.state.time.shape[1]
    return list(range(EDGE, n - EDGE + 1, stride(lot)))


def after(lot: "Lot", dwell: float) -> Array:
    """Step (n,): 0 before a dwell, 1 from it on."""
    return (np.arange(lot.state.time.shape[1]) >= dwell).astype(np.float64)


def common(values: Array) -> Array:
    """Values (units, ...) of all units; (1, ...) where they are the same for all."""
    return values[:1] if bool(np.all(values == values[:1])) else values


def common_force(lot: "Lot") -> Array:
    """Forces (units, n, 3), g; (1, n, 3) where they are the same for all units."""
    return lot.state.remember(
        ("common_force",), lambda: common(np.broadcast_to(lot.state.force, (*lot.state.time.shape, 3)))
    )


def rotated_force(lot: "Lot") -> Array:
    """Changes of the force by small rotations about x, y, z, (units or 1, n, 3, 3), g/rad."""
    return lot.state.remember(("rotated_force",), lambda: turns(common_force(lot)))


def turns(force: Array) -> Array:
    """Changes of forces (..., n, 3) by small rotations about x, y, z: (..., n, 3, 3), axis before rotation, g/rad."""
    return np.stack([np.cross(e, force) for e in np.eye(3)], axis=-1)


def tilts(state: State) -> Array:
    """Changes of the force by small errors of the outer and inner angle, (units or 1, n, 3, 2), g/rad."""
    outer, inner = state.outer, state.inner
    if outer is None or inner is None:
        return np.zeros((*state.force.shape, 0))
    outer, inner = common(outer), common(inner)
    by_outer = np.stack([np.cos(outer) * np.sin(inner), np.cos(outer) * np.cos(inner), -np.sin(outer)], axis=-1)
    by_inner = np.stack([np.sin(outer) * np.cos(inner), -np.sin(outer) * np.sin(inner), np.zeros_like(outer)], axis=-1)
    return np.stack([by_outer, by_inner], axis=-1)


def pose_errors(state: State) -> Array:
    """Changes of a dwell's force by two errors of the direction of its pose, (units or 1, n, 3, 2), g/rad.

    The errors are those of the two table angles where these are known, else rotations in two directions perpendicular to the
    stated force if it is the same for all units. Otherwise the last dimension is 0.
    """
    if state.outer is not None and state.inner is not None:
        return tilts(state)
    force = common(np.broadcast_to(state.force, (*state.time.shape, 3)))
    if len(force) > 1:
        return np.zeros((*state.force.shape, 0))
    # rounded, so that dwells of one pose, whose forces may differ by some µg, get the same two directions
    least = np.eye(3)[np.argmin(np.round(np.abs(force), 3), axis=-1)]
    first = np.cross(least, force)
    first *= np.linalg.norm(force, axis=-1, keepdims=True) / np.maximum(
        np.linalg.norm(first, axis=-1, keepdims=True), 1e-12
    )
    second = np.cross(force, first) / np.maximum(np.linalg.norm(force, axis=-1, keepdims=True), 1e-12)
    return np.stack([first, second], axis=-1)


def poses(lot: "Lot") -> Places:
    """Index of the pose of each dwell, (n,)."""
    force = lot.state.force.reshape(-1, *lot.state.force.shape[-2:])[0]
    return np.unique(np.round(force, 3), axis=0, return_inverse=True)[1].reshape(-1)


def soaks(state: State) -> Places:
    """Index of the soak of each dwell, (n,); all zero at constant temperature."""
    return state.remember(("soaks",), lambda: _soaks(state).astype(np.float64)).astype(np.intp)


def _soaks(state: State) -> Places:
    if state.temperature is None:
        return np.zeros(state.time.shape[-1], dtype=np.intp)
    typical = np.median(state.temperature.reshape(-1, state.temperature.shape[-1]), axis=0)
    soak = np.zeros(typical.size, dtype=np.intp)
    for k in range(1, typical.size):
        inside = typical[:k][soak[:k] == soak[k - 1]]
        soak[k] = soak[k - 1] + int(abs(typical[k] - float(np.median(inside))) > _SOAK_APART)
    return soak


def without(lot: "Lot", dwells: list[int]) -> "Lot":
    """The lot without some dwells of all units."""
    error = lot.error.copy()
    error[:, dwells] = np.inf
    return replace(lot, error=error)
