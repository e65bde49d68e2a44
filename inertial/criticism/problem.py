"""A lot's dwells as series in g: one block per unit and axis, or one per unit where only the norm of gravity is known."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.covariance import LARGE, Covariance
from inertial.criticism.handling.base import Handling, by_block
from inertial.criticism.lot import Lot
from inertial.criticism.space import Candidate
from inertial.effects import SensorEffect
from inertial.effects.base import AnyEffect, excited

Array = NDArray[np.float64]

SHARED = ("station", "data")
"""Scopes of effects whose coefficients all blocks share."""

_PIECE = 1_000_000
"""Number of columns processed at a time."""

_WIDEST = 3
"""Usual largest number of columns of an effect per axis."""

_CACHE = 8_000_000
"""Number of columns stored between passes; more are computed again, to limit the memory for large lots."""


Values = Mapping[str, float | tuple[float, ...]]
"""Nonlinear parameters and constants by name: one value, or one per sensor axis."""


def on_axis(values: Values, axis: int) -> dict[str, float]:
    """The values that hold for one sensor axis."""
    return {name: value[axis] if isinstance(value, tuple) else value for name, value in values.items()}


class Problem:
    """Series and columns of a lot by block.

    Parameters
    ----------
    slope : (units, n, 3), g/K, known response of the outputs to temperature: the factor of an error of the thermometer
    """

    def __init__(self, lot: Lot, *, slope: Array | None = None) -> None:
        self.lot, self.slope = lot, slope
        units, n = lot.state.time.shape
        self.blocks = units if lot.radial else 3 * units
        self.n = n
        self.error = self._error()
        self.y = self._series()
        self._kept: dict[tuple[object, ...], Candidate] = {}
        self._terms: dict[tuple[object, ...], Array] = {}
        # a model's own columns are stored, whatever the size of the lot
        self._room = _CACHE if self.y.size <= LARGE else _CACHE // 4

    @property
    def series(self) -> Array:
        """Measurements (blocks, n), g."""
        return self.y

    @cached_property
    def covariance(self) -> Covariance:
        """The covariances of the blocks, at any noise."""
        time = self.lot.state.time if self.lot.radial else np.repeat(self.lot.state.time, 3, axis=0)
        return Covariance(time, self.error, self._direction if self.lot.radial else None)

    def _series(self) -> Array:
        """Measurements (blocks, n), g: outputs, or the norm of the corrected output less 1 g."""
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

    def columns(self, effect: AnyEffect | Handling, values: Values) -> Array:
        """Columns of an effect by block, (blocks, n, p), g per unit of the coefficient; radial lots join the axes' columns."""
        key = (effect.id, *values.items())
        kept = self._terms.get(key)
        if kept is None:
            kept = self._columns(effect, values)
            if kept.size < self._room:
                self._room -= kept.size
                self._terms[key] = kept
        return kept

    def _columns(self, effect: AnyEffect | Handling, values: Values) -> Array:
        if isinstance(effect, Handling):
            return effect.columns(self.lot, self.slope, **on_axis(values, 0))
        if isinstance(effect, SensorEffect):
            state = self.lot.state
            axes = [effect.columns(state, axis, **on_axis(values, axis)) for axis in range(3)]
            return self._by_axis([excited(effect, columns) for columns in axes])
        return self.seen(effect.force_change(self.lot.state, **on_axis(values, 0)))

    def start(self, effect: AnyEffect | Handling, values: Values) -> Array:
        """Columns (blocks, n, k) of the unknown state of an effect's memory before the first dwell."""
        if isinstance(effect, Handling):
            return np.zeros((self.blocks, self.n, 0))
        if isinstance(effect, SensorEffect):
            state = self.lot.state
            columns = self._by_axis([effect.start_columns(state, axis, **on_axis(values, axis)) for axis in range(3)])
        else:
            columns = self.seen(effect.start_change(self.lot.state, **on_axis(values, 0)))
        # a state that decays before the second dwell leaves a column of one dwell only: it is kept, and this dwell has no
        # information
        return columns

    def _by_axis(self, axes: list[Array]) -> Array:
        """Columns of three axes, each (units or 1, n, p), by block."""
        state = self.lot.state
        shape = state.time.shape
        axes = [a if a.shape[:-1] == shape else np.broadcast_to(a, (*shape, a.shape[-1])) for a in axes]
        if self.lot.radial:
            weighted = [a * self._direction[..., i, None] for i, a in enumerate(axes)]
            return np.concatenate(weighted, axis=-1)
        return np.stack(axes, axis=1).reshape(self.blocks, self.n, -1)

    def seen(self, change: Array) -> Array:
        """Changes of force (units or 1, n, 3, q) as measured with every unit's response, by block."""
        state = self.lot.state
        seen = np.einsum(
            "uij,unjq->uinq", self.lot.response, np.broadcast_to(change, (*state.force.shape, change.shape[-1]))
        )
        seen = np.broadcast_to(seen, (state.time.shape[0], 3, self.n, seen.shape[-1]))
        if self.lot.radial:
            return np.einsum("uni,uinq->unq", self._direction, seen)
        return seen.reshape(self.blocks, self.n, -1)

    def candidate(self, effect: AnyEffect | Handling, grid: Sequence[Values], *, first: int | None = None) -> Candidate:
        """Columns of an effect over values of its nonlinear parameters; ``first`` keeps only so many columns an axis."""
        key = (effect.id, len(grid), tuple(grid[0].items()), tuple(grid[-1].items()), first)
        kept = self._kept.get(key)
        if kept is None:
            stacked = np.stack([self._columns(effect, values) for values in grid], axis=2)
            stacked = stacked if first is None else np.ascontiguousarray(stacked[..., :first])
            shared = effect.scope in SHARED
            distinct = None if shared else self._distinct(stacked)
            kept = Candidate(stacked, shared, key=key if len(grid) > 1 or not grid[0] else None, distinct=distinct)
            if stacked.size < self._room:
                self._room -= stacked.size
                self._kept[key] = kept
        return kept

    def _distinct(self, columns: Array) -> int | None:
        """How many blocks, the first, columns (blocks, ...) are repeated from: one, or one per axis; None where they are not."""
        for count in (1, 3):
            if not self.blocks % count and self.blocks > count:
                many = columns.reshape(-1, count, *columns.shape[1:])
                # most candidates differ in a few values already
                if np.array_equal(many[-1, :, -1], many[0, :, -1]) and bool(np.all(many == many[:1])):
                    return count
        return None

    def pieces(
        self, effect: AnyEffect | Handling, grid: Sequence[Values], *, first: int | None = None
    ) -> Iterator[Candidate]:
        """The candidate of an effect in pieces of its grid, small enough to limit the memory for large lots."""
        if isinstance(effect, Handling):
            yield from self._places(effect, grid)
            return
        width = 1 + self.blocks * self.n * _WIDEST
        size = max(1, _PIECE // width)
        for start in range(0, len(grid), size):
            yield self.candidate(effect, grid[start : start + size], first=first)

    def _places(self, effect: Handling, grid: Sequence[Values]) -> Iterator[Candidate]:
        """The places of an alternative, those of one unit together, no more at a time than a piece has room for."""
        units = self.lot.state.time.shape[0]
        for unit, places in groupby(grid, key=lambda values: values.get("unit")):
            every = list(places)
            size = max(1, _PIECE // (self.blocks * self.n * _WIDEST)) if unit is None else len(every)
            for start in range(0, len(every), size):
                each = every[start : start + size]
                key = (effect.id, unit, len(each), *each[0].items(), *each[-1].items())
                kept = self._kept.get(key)
                if kept is None:
                    changes = [effect.change(self.lot, self.slope, **on_axis(p, 0)) for p in each]
                    blocks = None
                    if unit is None:
                        changes = [np.broadcast_to(f, (units, *f.shape[1:])) for f in changes]
                    else:
                        blocks = 3 * int(on_axis({"unit": unit}, 0)["unit"]) + np.arange(3)
                    kept = Candidate(
                        np.stack([by_block(f) for f in changes], axis=2), shared=True, blocks=blocks, key=key
                    )
                    if kept.columns.size < self._room:
                        self._room -= kept.columns.size
                        self._kept[key] = kept
                yield kept
