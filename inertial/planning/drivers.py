"""Drivers of an effect: the quantities on which its columns depend, found by variation of a plan."""

from dataclasses import replace
from typing import Any

import numpy as np

from inertial import design, frames
from inertial import effects as catalogue
from inertial.arrays import Array
from inertial.effects import SensorEffect
from inertial.effects.base import AnyEffect, excited
from inertial.planning.remedies import Driver
from inertial.planning.sequences import SequenceStep, StationPace, extended
from inertial.quantities import LEFT_ALONE, RECORDED
from inertial.state import State

_OFF_S = 600.0  # time without power of the trial power cycle, s


def first_unit(state: State) -> State:
    """The state of the first unit of a lot."""
    while state.batch:
        state = state.pick(np.array([0], dtype=np.intp)) if state.batch[0] != 1 else state
        state = _squeezed(state)
    return state


def _squeezed(state: State) -> State:
    """The state of a lot of one unit without the dimension of the lot."""
    changed: dict[str, object] = {}
    for name, value in vars(state).items():
        if isinstance(value, np.ndarray):
            changed[name] = value[0]
        elif name == "covariates":
            changed[name] = {k: v[0] for k, v in state.covariates.items()}
    if state.history is not None:
        changed["history"] = replace(state.history, temperature=state.history.temperature[0])
    fields = {k: v for k, v in changed.items() if k in State.__dataclass_fields__}
    return replace(state, **fields, memory={})  # pyright: ignore[reportArgumentType]  # arrays stay arrays


def columns_of(state: State, effect: AnyEffect, values: dict[str, float], axis: int) -> Array:
    """Columns of an effect on one axis, (n, p)."""
    if isinstance(effect, SensorEffect):
        columns = excited(effect, effect.columns(state, axis, **values))
        return np.broadcast_to(columns, (state.force.shape[-2], columns.shape[-1]))
    return effect.force_change(state, **values)[:, axis, :]


def begins_again(state: State, effect_id: str) -> bool:
    """Whether an effect's column restarts after a power cycle, compared with the same time under power."""
    plan = first_unit(state)
    step = SequenceStep(0.0, 0.0, 25.0)
    off, on = (
        extended(plan, [replace(step, off=seconds)], StationPace(rest=_OFF_S - seconds)) for seconds in (_OFF_S, 0.0)
    )
    effect = catalogue.get(effect_id)
    values = design.starting_values([effect], plan).get(effect.id, {})
    ends = [columns_of(of, effect, values, axis)[-1] for of in (off, on) for axis in range(3)]
    return not np.allclose(np.concatenate(ends[:3]), np.concatenate(ends[3:]), rtol=1e-3, atol=1e-9)


def drivers_of(state: State, effect: AnyEffect) -> set[Driver]:
    """The quantities on which an effect's column depends, and the order of the dwells."""
    state = first_unit(state)
    values = design.starting_values([effect], state).get(effect.id, {})

    def columns(of: State) -> Array:
        return np.concatenate([columns_of(of, effect, values, axis) for axis in range(3)], axis=1)

    here = columns(state)
    drivers: set[Driver] = {
        driver for driver, changed in _varied(state) if not np.allclose(here, columns(changed), rtol=1e-6, atol=1e-9)
    }
    if {"temperature", "time"} <= drivers:
        drivers.add("rate")
    if "since_power" in drivers:
        drivers.add("time")
    if not np.allclose(columns(_reordered(state))[::-1], here, rtol=1e-6, atol=1e-9):
        drivers.add("order")
    return drivers


def _varied(state: State) -> list[tuple[Driver, State]]:
    """The plan with one quantity at a time varied."""
    rng = np.random.default_rng(1)
    n = state.force.shape[-2]
    turn = rng.uniform(0.2, 1.2, size=(2, n))
    variants: list[tuple[Driver, State]] = []
    if state.outer is not None and state.inner is not None:
        outer, inner = state.outer + turn[0], state.inner + turn[1]
        turned = replace(state, outer=outer, inner=inner, force=frames.force_from_angles(outer, inner))
    else:
        turned = replace(state, force=np.roll(state.force, 1, axis=-1) + 0.1)
    variants.append(("force", replace(turned, felt=None, output_run=None, memory={})))
    begin = float(np.min(state.time))
    span = max(float(np.ptp(state.time)), 1.0)
    late = begin + span * ((state.time - begin) / span) ** 1.5
    variants.append(("time", replace(state, time=late, history=None, memory={})))
    if state.temperature is not None:
        warm = state.temperature + rng.uniform(1.0, 15.0, size=n)
        variants.append(("temperature", replace(state, temperature=warm, history=None, memory={})))
    for name in ("since_move", "since_power", *(row.attribute for row in LEFT_ALONE)):
        value = getattr(state, name)
        if value is not None:
            changed: dict[str, Any] = {name: value * (1.0 + turn[0])}
            variants.append((name, replace(state, **changed, memory={})))
    return variants


_ROWS = (*(row.attribute for row in RECORDED if row.attribute and not row.once), "felt", "output_run")


def _reordered(state: State) -> State:
    """The plan with its dwells in the opposite order: an effect without memory has the same column, reversed."""
    changed: dict[str, Any] = {"history": None, "memory": {}, "force": state.force[::-1]}
    for name in _ROWS:
        value = getattr(state, name)
        changed[name] = None if value is None else value[::-1]
    changed["covariates"] = {k: v[::-1] for k, v in state.covariates.items()}
    return replace(state, **changed)
