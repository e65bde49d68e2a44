"""Design matrices of a model: the columns of its effects, and the names of their coefficients."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from inertial import effects as catalogue
from inertial.arrays import Array
from inertial.effects import SensorEffect, StationEffect
from inertial.effects.base import AnyEffect
from inertial.state import State

Values = Mapping[str, Mapping[str, Any]]
"""Nonlinear parameters and constants by effect id: one number, or a tuple of one per sensor axis."""


def on_axis(values: Values, effect: str, axis: int = 0) -> dict[str, float]:
    """The values of an effect that hold for one sensor axis."""
    of_effect = values.get(effect)
    return {name: v[axis] if isinstance(v, tuple) else v for name, v in of_effect.items()} if of_effect else {}


def split(names: Sequence[str]) -> tuple[list[SensorEffect], list[StationEffect]]:
    """The effects of a model: those of the sensor (and slot), those of the station.

    Raises
    ------
    UnknownEffect
        With the close matches.
    """
    effects: list[AnyEffect] = catalogue.get_all(names)
    sensor = [e for e in effects if isinstance(e, SensorEffect)]
    return sensor, [e for e in effects if isinstance(e, StationEffect)]


def starting_values(effects: Sequence[AnyEffect], state: State) -> dict[str, dict[str, float]]:
    """Constants, and the middle of the grid of every nonlinear parameter, by effect id."""
    values: dict[str, dict[str, float]] = {}
    for effect in effects:
        middle = {p.name: float(p.grid()[p.grid().size // 2]) for p in effect.parameters(state)}
        both = {**effect.constants(state), **middle}
        if both:
            values[effect.id] = both
    return values


def carried_over(values: Values) -> dict[str, dict[str, Any]]:
    """The values that hold in another run, too: without the state in which a run began, which is taken as at rest there."""
    of_run = {name: {p.name for p in catalogue.get(name).nonlinear if p.of_run} for name in values}
    return {name: {k: v for k, v in of_effect.items() if k not in of_run[name]} for name, of_effect in values.items()}


def local_columns(effects: Sequence[SensorEffect], state: State, values: Values) -> Array:
    """Columns of the sensor's effects, (..., m, n, p), g per unit of the coefficient; p counts the same on each of the m axes."""
    axes = [[e.columns(state, axis, **on_axis(values, e.id, axis)) for e in effects] for axis in state.axes]
    # columns that all units share are repeated where others differ from unit to unit
    shapes = {c.shape[:-1] for columns in axes for c in columns} or {state.time.shape}
    *batch, n = shapes.pop() if len(shapes) == 1 else np.broadcast_shapes(*shapes)
    # in memory one column after another: written across the rows of a large lot they take four times as long
    design = np.empty((*batch, len(axes), sum(c.shape[-1] for c in axes[0]), n))
    for axis, columns in enumerate(axes):
        start = 0
        for of_effect in columns:
            for column in range(of_effect.shape[-1]):
                design[..., axis, start + column, :] = of_effect[..., column]
            start += of_effect.shape[-1]
    return np.swapaxes(design, -1, -2)


def shared_columns(effects: Sequence[StationEffect], state: State, values: Values, response: Array) -> Array:
    """Columns of the station's effects in the output, (..., 3, n, q): changes of force seen through each unit's response.

    Parameters
    ----------
    response : (..., 3, 3), output per g: the matrix K of each unit
    """
    changes = np.concatenate([e.force_change(state, **on_axis(values, e.id)) for e in effects], axis=-1)
    return of_axes(np.einsum("...ij,...njq->...inq", response, changes), state.axes, -3)


def of_axes(values: Array, axes: tuple[int, ...], dimension: int) -> Array:
    """The values of the sensor axes that have an output; all as they are of a device with three."""
    return values if len(axes) == 3 else np.take(values, axes, axis=dimension)


def local_names(
    effects: Sequence[SensorEffect], axis: int, values: Values | None = None
) -> tuple[tuple[str, str], ...]:
    """(effect id, coefficient name) of every local column of an axis; all that there may be where no values are given."""
    known: Values = values or {}
    return tuple((e.id, name) for e in effects for name in e.names_at(axis, **on_axis(known, e.id, axis)))


def shared_names(effects: Sequence[StationEffect]) -> tuple[tuple[str, str], ...]:
    """(effect id, parameter name) of every shared column."""
    return tuple((e.id, name) for e in effects for name in e.names())


def grid_of(effect: AnyEffect, state: State) -> list[dict[str, float]]:
    """Starting values of an effect's nonlinear parameters, with its constants, as a list of keyword sets."""
    constants = dict(effect.constants(state))
    parameters = effect.parameters(state)
    if not parameters:
        return [constants]
    values = product(*(p.grid().tolist() for p in parameters))
    names = [p.name for p in parameters]
    return [{**constants, **dict(zip(names, v, strict=True))} for v in values]


def resting_grid(effect: AnyEffect, state: State) -> list[dict[str, float]]:
    """Starting values for a run that begins at rest: what a plan can show may not depend on the state that a run begins in."""
    return [values for values in grid_of(effect, state) if at_rest(effect, values)]


def at_rest(effect: AnyEffect, values: Mapping[str, float]) -> bool:
    """Whether values of an effect are those of a run that begins at rest."""
    return all(values.get(p.name, 0.0) == 0.0 for p in effect.nonlinear if p.of_run)
