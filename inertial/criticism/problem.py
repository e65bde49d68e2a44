"""A lot's dwells as series in g: one block per unit and axis, or one per unit where only the norm of gravity is known."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.noise import Basis, basis
from inertial.criticism.space import Candidate
from inertial.effects import SensorEffect
from inertial.effects.base import AnyEffect, excited
from inertial.state import State

Array = NDArray[np.float64]

_PIECE = 4_000_000
"""Numbers of rotated columns worked on at a time."""

_WIDEST = 3
"""Columns an axis that an effect usually has at the most."""

_CACHE = 15_000_000
"""Numbers of rotated columns kept between passes; beyond, they are made again: memory stays bounded for large lots."""


Values = Mapping[str, float | tuple[float, ...]]
"""Nonlinear parameters and constants by name: one value, or one per sensor axis."""


def on_axis(values: Values, axis: int) -> dict[str, float]:
    """The values that hold for one sensor axis."""
    return {name: value[axis] if isinstance(value, tuple) else value for name, value in values.items()}


@dataclass(frozen=True)
class Lot:
    """Measurements of a lot in g.

    state : the dwells of all units, (units, n)
    output : (units, n, 3), output over the nominal scale: g
    error : (units, n, 3), white standard error of each dwell mean, g; infinite where a dwell is missing
    response : (units, 3, 3), K over its diagonal: how a change of force shows on each axis
    radial : only the norm of the force is known; the state's force is then the corrected output's own direction
    """

    state: State
    output: Array
    error: Array
    response: Array
    radial: bool = False

    def units(self, index: Sequence[int]) -> "Lot":
        """The lot of some units only."""
        pick = np.asarray(index, dtype=np.intp)
        return replace(
            self,
            state=self.state.pick(pick),
            output=self.output[pick],
            error=self.error[pick],
            response=self.response[pick],
        )


class Problem:
    """Series and columns of a lot in the blocks' rotated coordinates; ``steep`` wander has a random walk in it."""

    def __init__(self, lot: Lot, *, steep: bool = False) -> None:
        self.lot, self.steep = lot, steep
        units, n = lot.state.time.shape
        self.blocks = units if lot.radial else 3 * units
        self.n = n
        self.error = self._error()
        self.series = self._series()
        self._kept: dict[tuple[object, ...], Candidate] = {}
        self._terms: dict[tuple[object, ...], Array] = {}
        self._room = _CACHE

    @cached_property
    def basis(self) -> Basis:
        """The rotation in which the noise of the dwells is diagonal."""
        time = self.lot.state.time if self.lot.radial else np.repeat(self.lot.state.time, 3, axis=0)
        return basis(time, self.error, steep=self.steep)

    @cached_property
    def y(self) -> Array:
        """Rotated measurements, (blocks, n)."""
        return self.basis.rotate(self.series[..., None])[..., 0]

    def _series(self) -> Array:
        """Measurements (blocks, n), g: outputs, or what the norm of the corrected output exceeds 1 g by."""
        if self.lot.radial:
            return np.einsum("unj,unj->un", self._direction, self.lot.output) - 1.0
        return np.swapaxes(self.lot.output, -1, -2).reshape(self.blocks, self.n)

    def _error(self) -> Array:
        if self.lot.radial:
            squares = np.where(np.isfinite(self.lot.error), self.lot.error, 0.0) ** 2
            total = np.sqrt(np.einsum("unj,unj->un", self._direction**2, squares))
            return np.where(np.isfinite(self.lot.error).all(axis=-1), total, np.inf)
        return np.swapaxes(self.lot.error, -1, -2).reshape(self.blocks, self.n)

    @cached_property
    def _direction(self) -> Array:
        return self.lot.state.force / np.linalg.norm(self.lot.state.force, axis=-1, keepdims=True)

    @property
    def count(self) -> int:
        """Number of measurements."""
        return int(np.isfinite(self.error).sum())

    def columns(self, effect: AnyEffect, values: Values) -> Array:
        """Columns of an effect by block, (blocks, n, p), g per unit of the coefficient; radial lots join the axes' columns."""
        if isinstance(effect, SensorEffect):
            state = self.lot.state
            axes = [effect.columns(state, axis, **on_axis(values, axis)) for axis in range(3)]
            return self._by_axis([excited(effect, columns) for columns in axes])
        return self.seen(effect.force_change(self.lot.state, **on_axis(values, 0)))

    def start(self, effect: AnyEffect, values: Values) -> Array:
        """Columns (blocks, n, k) of the unknown state of an effect's memory before the first dwell."""
        if isinstance(effect, SensorEffect):
            state = self.lot.state
            columns = self._by_axis([effect.start_columns(state, axis, **on_axis(values, axis)) for axis in range(3)])
        else:
            columns = self.seen(effect.start_change(self.lot.state, **on_axis(values, 0)))
        # a state taken up before the second dwell leaves a column of one dwell only: it is kept, the dwell tells nothing then
        return columns

    def _by_axis(self, axes: list[Array]) -> Array:
        """Columns of three axes, each (units or 1, n, p), by block."""
        state = self.lot.state
        axes = [np.broadcast_to(a, (*state.time.shape, a.shape[-1])) for a in axes]
        if self.lot.radial:
            weighted = [a * self._direction[..., i, None] for i, a in enumerate(axes)]
            return np.concatenate(weighted, axis=-1)
        return np.stack(axes, axis=1).reshape(self.blocks, self.n, -1)

    def seen(self, change: Array) -> Array:
        """Changes of force (units or 1, n, 3, q) seen through every unit's response, by block."""
        state = self.lot.state
        seen = np.einsum(
            "uij,unjq->uinq", self.lot.response, np.broadcast_to(change, (*state.force.shape, change.shape[-1]))
        )
        seen = np.broadcast_to(seen, (state.time.shape[0], 3, self.n, seen.shape[-1]))
        if self.lot.radial:
            return np.einsum("uni,uinq->unq", self._direction, seen)
        return seen.reshape(self.blocks, self.n, -1)

    def rotated(self, effect: AnyEffect, values: Values) -> Array:
        """Rotated columns (blocks, n, p) of an effect."""
        key = (effect.id, *values.items())
        kept = self._terms.get(key)
        if kept is None:
            kept = self.basis.rotate(self.columns(effect, values))
            if kept.size < self._room:
                self._room -= kept.size
                self._terms[key] = kept
        return kept

    def candidate(self, effect: AnyEffect, grid: Sequence[Values], *, first: int | None = None) -> Candidate:
        """Rotated columns of an effect over values of its nonlinear parameters; ``first`` keeps only so many columns an axis."""
        key = (effect.id, len(grid), tuple(grid[0].items()), tuple(grid[-1].items()))
        kept = self._kept.get(key)
        if kept is None:
            stacked = np.stack([self.basis.rotate(self.columns(effect, values)) for values in grid], axis=2)
            kept = Candidate(stacked, shared=effect.scope == "station")
            if stacked.size < self._room:
                self._room -= stacked.size
                self._kept[key] = kept
        if first is None:
            return kept
        return Candidate(kept.columns[..., :first], kept.shared)

    def pieces(self, effect: AnyEffect, grid: Sequence[Values], *, first: int | None = None) -> Iterator[Candidate]:
        """The candidate of an effect in pieces of its grid, so small that large lots are worked on in bounded memory."""
        width = 1 + self.blocks * self.n * _WIDEST
        size = max(1, _PIECE // width)
        for start in range(0, len(grid), size):
            yield self.candidate(effect, grid[start : start + size], first=first)
