"""What an effect may look at: the dwells of one unit, or of a lot, as arrays with the dwells in order of time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Self

import numpy as np

from inertial import frames
from inertial.arrays import Array, Places
from inertial.errors import MissingInput
from inertial.quantities import column_of

_REMEMBERED = 3_000_000
"""Largest number of values that a state remembers of operators with memory."""

_WAYPOINTS = 48
"""Points at which the force between two poses of the table is looked at."""

_ANGLES_AGREE = 0.01
"""Largest difference, g, of the force of a dwell from that of its angles, where the way can be told from the angles."""

ALL_AXES = (0, 1, 2)

T_REFERENCE = 25.0
"""Reference temperature in °C: θ = T − 25 °C."""


@dataclass(frozen=True)
class History:
    """Temperatures between the dwells, at the station's own rate.

    time : (m,), s
    temperature : (..., m), °C, the sensor's temperature (batch dimensions as in the state)
    """

    time: Array
    temperature: Array


@dataclass(frozen=True)
class State:
    """Dwells of one unit or a lot; every array has the batch dimensions (...), then n dwells in order of time.

    force : (..., n, 3), g, specific force in the fixture's frame
    time : (..., n), s since the run began
    temperature : (..., n), °C, the sensor's own
    chamber : (..., n), °C
    since_power, since_move : (..., n), s
    power_off : (..., n), s without power right before the dwell; 0 where the devices stayed on, None where it was never off
    supply : (..., n), V
    vibration : (..., n), g rms
    outer, inner : (..., n), rad, table angles
    heading : (..., n), rad, direction about the vertical of units put down by hand (:func:`inertial.frames.horizontal`)
    slot : (...,), number of the fixture's slot
    felt : (..., n, 3), g, force along the sensor's own axes where its misalignment is known: what its gain and its nonlinearity
        answer to
    output_run : (..., n, 3), g, what bias and scale factor add to the output by their run with temperature, where it is known
    covariates : further recorded quantities by name, (..., n)
    reference : °C, what ``theta`` counts from
    axes : sensor axes that have an output, in order; a single-axis device has one, and rows for the others do not exist
    """

    force: Array
    time: Array
    temperature: Array | None = None
    chamber: Array | None = None
    since_power: Array | None = None
    since_move: Array | None = None
    power_off: Array | None = None
    supply: Array | None = None
    vibration: Array | None = None
    outer: Array | None = None
    inner: Array | None = None
    heading: Array | None = None
    slot: Array | None = None
    felt: Array | None = None
    output_run: Array | None = None
    covariates: Mapping[str, Array] = field(default_factory=dict[str, Array])
    history: History | None = None
    reference: float = T_REFERENCE
    axes: tuple[int, ...] = ALL_AXES
    memory: dict[tuple[object, ...], Array] = field(
        default_factory=dict[tuple[object, ...], Array], repr=False, compare=False
    )

    def remember(self, key: tuple[object, ...], make: Callable[[], Array]) -> Array:
        """The array that ``make`` returns, computed once per key: operators with memory are the same for every axis."""
        if key not in self.memory:
            array = make()
            # all have about one size; the oldest go first
            while self.memory and (len(self.memory) + 1) * array.size > _REMEMBERED:
                del self.memory[next(iter(self.memory))]
            self.memory[key] = array
        return self.memory[key]

    def need(self, quantity: str, effect: str) -> Array:
        """The array of a quantity, or :class:`MissingInput` naming the effect that needs it."""
        value = self.covariates.get(quantity) if quantity in self.covariates else getattr(self, quantity, None)
        if value is None:
            raise MissingInput(effect, column_of(quantity))
        return value

    def along(self, axis: int) -> Array:
        """Specific force along the sensor's own axis, (..., n), g; along the fixture's where the misalignment is not known."""
        return (self.force if self.felt is None else self.felt)[..., axis]

    def converted(self, axis: int, run: float = 1.0) -> Array:
        """What the electronics of an axis has at its input, (..., n), g: the force along it, and the run with temperature.

        The steps of a converter, a limit or a threshold stand elsewhere in a warm unit; those of a mechanism (``run`` 0) do not.
        """
        along = self.along(axis)
        return along if self.output_run is None else along + run * self.output_run[..., axis]

    @cached_property
    def theta(self) -> Array | None:
        """Temperature above the reference, (..., n), K."""
        return None if self.temperature is None else self.temperature - self.reference

    @cached_property
    def temperature_rate(self) -> Array | None:
        """dT/dt at each dwell, (..., n), K/min: from the history where there is one, else from neighbouring dwells."""
        if self.temperature is None:
            return None
        if self.history is not None:
            return 60.0 * _smooth_slope(self.history.time, self.history.temperature, self.time)
        return 60.0 * _slope(self.time, self.temperature)

    @cached_property
    def force_step(self) -> Array:
        """Change of specific force at the move before each dwell, (..., n, 3), g; zero for the first dwell."""
        return np.diff(self.force, axis=-2, prepend=self.force[..., :1, :])

    @cached_property
    def way(self) -> Array | None:
        """Extremes of force on the way to each dwell in the order in which they come, and the dwell's own, (..., n, 3, 3), g.

        The last index but one counts them: two on the way, then the dwell. Both axes of the table are taken to turn at once and
        straight from pose to pose. None where the angles of the table are not known, or do not give the force.
        """
        if self.outer is None or self.inner is None:
            return None
        turns, force = np.stack([self.outer, self.inner]), self.force
        if self.batch and np.all(turns == turns[..., :1, :]) and np.all(force == force[..., :1, :, :]):
            turns, force = turns[..., :1, :], force[..., :1, :, :]  # one table turns all alike
        before = np.concatenate([turns[..., :1], turns[..., :-1]], axis=-1)
        part = np.arange(1, _WAYPOINTS) / _WAYPOINTS
        between = frames.force_from_angles(*(before[..., None] + (turns - before)[..., None] * part))
        rotation = _rotation(frames.force_from_angles(*turns), force)
        if rotation is None:
            return None
        between = between @ rotation[..., None, :, :]
        low, high = between.argmin(axis=-2), between.argmax(axis=-2)
        extremes = np.stack([np.minimum(low, high), np.maximum(low, high)], axis=-2)
        way = np.concatenate([np.take_along_axis(between, extremes, axis=-2), force[..., None, :]], axis=-2)
        return np.broadcast_to(way, (*self.batch, *way.shape[-3:]))

    @property
    def batch(self) -> tuple[int, ...]:
        """Batch dimensions."""
        return self.force.shape[:-2]

    def temperature_operator(self, key: tuple[object, ...], operator: Callable[[Array, Array], Array]) -> Array:
        """``operator(time, temperature)`` read at the dwells, (..., n): run on the history where there is one.

        Raises
        ------
        MissingInput
            The dwells carry no temperature.
        """

        def run() -> Array:
            if self.temperature is None:
                raise MissingInput(str(key[0]), "unit_C")
            if self.history is None:
                return operator(self.time, self.temperature)
            return _at_dwells(self.history.time, operator(self.history.time, self.history.temperature), self.time)

        return self.remember(key, run)

    def pick(self, index: slice | Places) -> Self:
        """The units at ``index`` along the first batch dimension."""
        changed: dict[str, object] = {}
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                changed[item.name] = value[index]
            elif item.name == "covariates":
                changed[item.name] = {k: v[index] for k, v in self.covariates.items()}
            elif isinstance(value, History):
                changed[item.name] = History(value.time, value.temperature[index])
        changed["memory"] = {}
        return replace(self, **changed)


def _rotation(table: Array, force: Array) -> Array | None:
    """Rotations (..., 3, 3) of forces (..., n, 3) in a table's frame to those that are known; None where they do not agree.

    A unit may have directions of its own on the fixture; of poses in one line they are known only if they are the table's.
    """
    if not np.isfinite(table).all():
        return None
    if np.abs(table - force).max() < _ANGLES_AGREE:
        return np.broadcast_to(np.eye(3), (*force.shape[:-2], 3, 3))
    u, size, v = np.linalg.svd(np.swapaxes(table, -1, -2) @ force)
    if np.any(size[..., 1] < _ANGLES_AGREE * size[..., 0]):
        return None
    u[..., :, 2] *= np.linalg.det(u @ v)[..., None]
    rotation = u @ v
    return rotation if np.abs(table @ rotation - force).max() < _ANGLES_AGREE else None


def _slope(time: Array, values: Array) -> Array:
    """Central differences along the last axis, with the shapes of ``time`` and ``values`` broadcast."""
    t, v = np.broadcast_arrays(time, values)
    if v.shape[-1] < 2:
        return np.zeros(v.shape)
    before = np.concatenate([v[..., :1], v[..., :-1]], axis=-1)
    after = np.concatenate([v[..., 1:], v[..., -1:]], axis=-1)
    t_before = np.concatenate([t[..., :1], t[..., :-1]], axis=-1)
    t_after = np.concatenate([t[..., 1:], t[..., -1:]], axis=-1)
    return (after - before) / np.maximum(t_after - t_before, 1e-9)


_RATE_WINDOW = 30.0
"""Half width in s over which a history's slope is taken: the noise of a thermometer read every few seconds is no rate."""


def _smooth_slope(grid: Array, values: Array, time: Array) -> Array:
    """Slope of the straight line through the values (..., m) within the window about each of the times (..., n), per s."""
    step = float(np.median(np.diff(grid)))
    half = max(1, round(_RATE_WINDOW / step))
    offset = np.arange(-half, half + 1) * step
    weights = offset / np.sum(offset**2)
    padded = np.concatenate(
        [np.repeat(values[..., :1], half, axis=-1), values, np.repeat(values[..., -1:], half, axis=-1)], axis=-1
    )
    slopes = np.apply_along_axis(lambda v: np.convolve(v, weights[::-1], mode="valid"), -1, padded)
    return _at_dwells(grid, slopes, time)


def _at_dwells(grid: Array, values: Array, time: Array) -> Array:
    """Values on ``grid`` (m,) read at ``time`` (..., n), linear in between, constant beyond the ends."""
    flat_values = values.reshape(-1, values.shape[-1])
    flat_time = np.broadcast_to(time, (*values.shape[:-1], time.shape[-1])).reshape(-1, time.shape[-1])
    if len(grid) < 2 or not np.array_equal(flat_time, np.broadcast_to(flat_time[:1], flat_time.shape)):
        picked = np.array([np.interp(t, grid, v) for t, v in zip(flat_time, flat_values, strict=True)])
    else:
        # units read at the same times share the intervals of the grid; the numbers are those of np.interp
        at = np.clip(flat_time[0], grid[0], grid[-1])
        lower = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
        below = flat_values[:, lower]
        step = grid[lower + 1] - grid[lower]
        slope = (flat_values[:, lower + 1] - below) / np.where(step > 0.0, step, 1.0)
        picked = slope * (at - grid[lower]) + below
        picked = np.where(at == grid[-1], flat_values[:, -1:], picked)
    return picked.reshape(*values.shape[:-1], time.shape[-1])
