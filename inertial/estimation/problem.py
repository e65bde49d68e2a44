"""A lot's dwells as series in g: one block per unit and axis, or one per unit where only the norm of gravity is known."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from inertial.arrays import Array, Places
from inertial.design import of_axes
from inertial.effects import SensorEffect
from inertial.effects.base import AnyEffect, excited, has_start
from inertial.estimation.alternative import Handling, by_block, of_outputs
from inertial.estimation.candidate import Candidate, blocks_of_units, finest_rows, shared_rows
from inertial.estimation.covariance import Covariance
from inertial.estimation.lot import Lot
from inertial.estimation.noise_shares import Shares

SHARED = ("station", "data")
"""Scopes of effects whose coefficients all blocks share."""

_PIECE = 1_000_000
"""Number of column elements processed at a time."""

_WIDE = 3_000_000
"""Number of elements of an effect's columns processed at a time; larger, because each pass also reads the model's columns."""

_WIDEST = 3
"""Usual largest number of columns of an effect per axis."""

_CACHE = 5_000_000
"""Number of column elements stored between passes; further ones are computed again, to limit memory in large lots."""


Values = Mapping[str, float | tuple[float, ...]]
"""Nonlinear parameters and constants by name: one value, or one per sensor axis."""


def on_axis(values: Values, axis: int) -> dict[str, float]:
    """The values that hold for one sensor axis."""
    return {name: value[axis] if isinstance(value, tuple) else value for name, value in values.items()}


def _per_axis(
    effect: SensorEffect, values: Values, axes: Sequence[int], made: Callable[[int, dict[str, float]], Array]
) -> list[Array]:
    """Result of ``made(axis, values)`` for each axis; computed once where neither effect nor values depend on the axis."""
    if effect.same_on_axes and not any(isinstance(value, tuple) for value in values.values()):
        return [made(0, on_axis(values, 0))] * len(axes)
    return [made(axis, on_axis(values, axis)) for axis in axes]


@dataclass(frozen=True)
class KnownDeviances:
    """Restricted deviances of all models of equal terms, by the shares of the noise.

    of_lot : of all blocks together; of_blocks : of single blocks, less their log-determinants
    """

    of_lot: dict[Shares, float] = field(default_factory=dict[Shares, float])
    of_blocks: dict[tuple[int, Shares], float] = field(default_factory=dict[tuple[int, Shares], float])


class Problem:
    """Measured series and effect columns of a lot by block.

    Parameters
    ----------
    slope : (units, n, 3), g/K, known derivative of the outputs by temperature: the effect of a thermometer error per kelvin
    """

    def __init__(self, lot: Lot, *, slope: Array | None = None) -> None:
        self.lot, self.slope = lot, slope
        units, n = lot.state.time.shape
        self.axes = lot.state.axes
        self.blocks = units if lot.radial else len(self.axes) * units
        self.n = n
        self.error = self._error()
        self.y = self._series()
        self._store: dict[tuple[object, ...], Candidate] = {}
        self._terms: dict[tuple[object, ...], Array] = {}
        self._room = _CACHE
        self.deviances: dict[frozenset[tuple[object, ...]], KnownDeviances] = {}
        """Known deviances of models, by the keys of their terms."""

    @cached_property
    def covariance(self) -> Covariance:
        """The noise covariances of the blocks."""
        time = self.lot.state.time if self.lot.radial else np.repeat(self.lot.state.time, len(self.axes), axis=0)
        direction, together = (self._direction, self.blocks) if self.lot.radial else (None, self.per_unit)
        return Covariance(time, self.error, direction, self.lot.loudness, together)

    def forget(self) -> None:
        """Drop the stored columns and products; they are computed again when needed."""
        self._store.clear()
        self._terms.clear()
        self._room = _CACHE
        self.covariance.forget()
        self.lot.state.memory.clear()

    def _series(self) -> Array:
        """Measurements (blocks, n), g: outputs, or the output along the corrected output's direction less 1 g."""
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

    @cached_property
    def first_unit(self) -> "Problem":
        """The problem of the first unit alone."""
        return Problem(self.lot.units([0]))

    @property
    def per_unit(self) -> int:
        """Blocks of one unit: its axes, or one where only the norm of gravity is known."""
        return 1 if self.lot.radial else len(self.axes)

    @property
    def count(self) -> int:
        """Number of measurements."""
        return int(np.isfinite(self.error).sum())

    def columns(self, effect: AnyEffect | Handling, values: Values) -> Array:
        """Columns of an effect by block, (blocks, n, p), g per unit of the coefficient; a radial block has those of all axes."""
        key = (effect.id, *values.items())
        stored = self._terms.get(key)
        if stored is None:
            stored = self._columns(effect, values)
            if stored.size < self._room:
                self._room -= stored.size
                self._terms[key] = stored
        return stored

    def _columns(self, effect: AnyEffect | Handling, values: Values) -> Array:
        if isinstance(effect, Handling):
            return effect.columns(self.lot, self.slope, **on_axis(values, 0))
        if isinstance(effect, SensorEffect):
            state = self.lot.state
            return self._by_axis(
                _per_axis(
                    effect,
                    values,
                    self.axes,
                    lambda axis, of_axis: excited(effect, effect.columns(state, axis, **of_axis)),
                )
            )
        return self.seen(effect.force_change(self.lot.state, **on_axis(values, 0)))

    def start(self, effect: AnyEffect | Handling, values: Values) -> Array:
        """Columns (blocks, n, k) of the unknown state of an effect's memory before the first dwell."""
        if isinstance(effect, Handling) or not has_start(effect):
            return np.zeros((self.blocks, self.n, 0))
        # a state that decays before the second dwell affects only the first; the column stays, so that dwell has no information
        state = self.lot.state
        if isinstance(effect, SensorEffect):
            return self._by_axis(
                _per_axis(effect, values, self.axes, lambda axis, of_axis: effect.start_columns(state, axis, **of_axis))
            )
        return self.seen(effect.start_change(state, **on_axis(values, 0)))

    def _by_axis(self, axes: list[Array]) -> Array:
        """Columns by block, (blocks, n, p), from those of each axis, (units or 1, n, p); radial: (units, n, axes · p)."""
        state = self.lot.state
        shape = state.time.shape
        if self.lot.radial:
            axes = [a if a.shape[:-1] == shape else np.broadcast_to(a, (*shape, a.shape[-1])) for a in axes]
            weighted = [a * self._direction[..., i, None] for i, a in enumerate(axes)]
            return np.concatenate(weighted, axis=-1)
        joined = np.empty((shape[0], len(self.axes), shape[1], axes[0].shape[-1]))
        for axis, columns in enumerate(axes):
            joined[:, axis] = columns
        return joined.reshape(self.blocks, self.n, -1)

    def seen(self, change: Array) -> Array:
        """Measured changes (blocks, n, q), g, for changes of force (units or 1, n, 3, q), g, with each unit's response."""
        state = self.lot.state
        seen = np.einsum(
            "uij,unjq->uinq", self.lot.response, np.broadcast_to(change, (*state.force.shape, change.shape[-1]))
        )
        seen = np.broadcast_to(seen, (state.time.shape[0], 3, self.n, seen.shape[-1]))
        if self.lot.radial:
            return np.einsum("uni,uinq->unq", self._direction, seen)
        return of_axes(seen, self.axes, 1).reshape(self.blocks, self.n, -1)

    def candidate(self, effect: AnyEffect | Handling, grid: Sequence[Values], *, first: int | None = None) -> Candidate:
        """The candidate of an effect at several values of its nonlinear parameters.

        Parameters
        ----------
        first : number of leading columns per axis that are used; all if None
        """
        key = (effect.id, len(grid), tuple(grid[0].items()), tuple(grid[-1].items()), first)
        return self._stored(key, lambda: self.varied(effect, grid, first=first, key=key))

    def _stored(self, key: tuple[object, ...], make: Callable[[], Candidate]) -> Candidate:
        """The stored candidate of a key, else a new one, which is stored if its columns fit into the cache."""
        candidate = self._store.get(key)
        if candidate is None:
            candidate = make()
            if candidate.columns.size < self._room:
                self._room -= candidate.columns.size
                self._store[key] = candidate
        return candidate

    @property
    def at_a_time(self) -> int:
        """Number of parameter values whose columns are processed together; few in a large lot, to limit memory."""
        return max(1, _WIDE // (1 + self.blocks * self.n * _WIDEST))

    def varied(
        self,
        effect: AnyEffect | Handling,
        grid: Sequence[Values],
        *,
        first: int | None = None,
        start: bool = False,
        key: object = None,
    ) -> Candidate:
        """The candidate of an effect at several parameter values, not stored; rows that blocks share are held once.

        Parameters
        ----------
        first : number of leading columns per axis; all if None
        start : whether columns of a memory's unknown initial state follow
        key : key of stored products; None for a candidate that is tried once
        """
        shared = effect.scope in SHARED
        every: list[Array] = []
        rows_of: list[Places | None] = []
        for values in grid:
            known = self._terms.get((effect.id, *values.items()))
            part = (self._columns(effect, values) if known is None else known)[..., :first]
            if start:
                part = np.concatenate([part, self.start(effect, values)], axis=-1)
            rows = None if shared else shared_rows(part, self.per_unit)
            every.append(part if rows is None else part[np.unique(rows, return_index=True)[1]])
            rows_of.append(rows)
        rows = finest_rows(rows_of, self.per_unit)
        count = self.blocks if rows is None else int(rows.max()) + 1
        columns = np.empty((count, len(grid), every[0].shape[-1], self.n))
        for k, (part, of_own) in enumerate(zip(every, rows_of, strict=True)):
            if len(part) < count and of_own is not None:
                part = part[of_own if rows is None else of_own[np.unique(rows, return_index=True)[1]]]  # noqa: PLW2901
            columns[:, k] = np.swapaxes(part, -1, -2)
        return Candidate(columns.transpose(0, 3, 1, 2), shared, rows=rows, key=key)

    def pieces(
        self, effect: AnyEffect | Handling, grid: Sequence[Values], *, first: int | None = None
    ) -> Iterator[Candidate]:
        """Candidates of an effect for successive pieces of its grid, small enough to limit memory in large lots."""
        if isinstance(effect, Handling):
            yield from self._at_locations(effect, grid)
            return
        size, begin = self.at_a_time, 0
        while begin < len(grid):
            made = self.candidate(effect, grid[begin : begin + size], first=first)
            yield made
            begin += size
            if made.rows is not None:
                size = max(1, _PIECE // made.columns[:, :, 0].size)

    def _at_locations(self, effect: Handling, grid: Sequence[Values]) -> Iterator[Candidate]:
        """Candidates of a handling error for successive pieces of its locations, which are ordered by unit."""
        if grid and ("unit" not in grid[0] or "other" in grid[0]):
            alike = len(effect.change(self.lot, self.slope, **on_axis(grid[0], 0))) == 1
            size = max(1, _PIECE // ((len(self.axes) if alike else self.blocks) * self.n * _WIDEST))
            for start in range(0, len(grid), size):
                yield self._at_common_locations(effect, grid[start : start + size])
            return
        by_unit = [list(locations) for _, locations in groupby(grid, key=lambda values: values["unit"])]
        for locations, alike in groupby(by_unit, key=_without_unit):
            units = np.array([int(on_axis({"unit": of_unit[0]["unit"]}, 0)["unit"]) for of_unit in alike])
            size = max(1, _PIECE // (len(self.axes) * self.n * _WIDEST * len(locations)))
            yield from self._of_units(effect, units, [dict(location) for location in locations], size)

    def _of_units(self, effect: Handling, units: Places, locations: Sequence[Values], size: int) -> Iterator[Candidate]:
        """Candidates of a one-unit error at equal locations in some units; at most ``size`` units each if columns differ."""
        key = (effect.id, units.size, int(units[0]), len(locations), *locations[0].items(), *locations[-1].items())

        def made() -> Candidate:
            columns = np.stack(
                [of_outputs(self.lot, effect.of_each_unit(self.lot, self.slope, **on_axis(p, 0))) for p in locations],
                axis=3,
            )
            few, n, m, g, k = columns.shape
            rows = np.tile(np.arange(m), units.size) if few == 1 else None
            by_block = np.swapaxes(columns, 1, 2).reshape(m * few, n, g, k)
            return Candidate(by_block, shared=True, rows=rows, units=units, key=key, per_unit=m)

        candidate = self._stored(key, made)
        if candidate.rows is not None:
            yield candidate
            return
        for start in range(0, units.size, size):
            some = units[start : start + size]
            blocks = blocks_of_units(some, len(self.axes))
            yield replace(candidate, columns=candidate.columns[blocks], units=some, key=(*key, start, size))

    def _at_common_locations(self, effect: Handling, locations: Sequence[Values]) -> Candidate:
        """Candidate of a handling error at some locations, with coefficients that all blocks share."""
        key = (effect.id, len(locations), *locations[0].items(), *locations[-1].items())

        def made() -> Candidate:
            changes = [of_outputs(self.lot, effect.change(self.lot, self.slope, **on_axis(p, 0))) for p in locations]
            units = self.lot.state.time.shape[0]
            rows = np.tile(np.arange(len(self.axes)), units) if all(len(f) == 1 for f in changes) else None
            if rows is None:
                changes = [np.broadcast_to(f, (units, *f.shape[1:])) for f in changes]
            return Candidate(np.stack([by_block(f) for f in changes], axis=2), shared=True, rows=rows, key=key)

        return self._stored(key, made)


def _without_unit(locations: Sequence[Values]) -> tuple[tuple[tuple[str, float | tuple[float, ...]], ...], ...]:
    """A hashable key of locations without their unit: equal for units with the same locations."""
    return tuple(tuple((name, value) for name, value in location.items() if name != "unit") for location in locations)
