"""Sequences of further dwells: steps of a station, their times and temperatures, and the state of a lot with them appended."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from inertial import frames
from inertial.arrays import Array
from inertial.quantities import LEFT_ALONE
from inertial.state import T_REFERENCE, History, State
from inertial.timing import Air, Drive, SoakRule, followed, settling_s, soaked

_GRAIN_S = 15.0  # time step of the air and device temperatures between dwells, s
_STILL_K, _LONG_S = 0.02, 120.0
"""Temperature difference below which the temperatures count as constant, K, and the time step then, s."""

_STILL_RATE, _ENOUGH = 1e-3, 3
"""Rate, K/s, below which a device counts as settled between two dwells, and how many dwells of that kind tell its own heat."""


@dataclass(frozen=True)
class SequenceStep:
    """One dwell to measure.

    outer, inner : rad
    temperature : °C, of the chamber
    wait : s, from the end of the move to the start of the dwell
    soaked : whether the devices settle at the temperature first; else the dwell is measured during the temperature change
    off : s without power before the dwell
    """

    outer: float
    inner: float
    temperature: float
    wait: float = 2.0
    soaked: bool = True
    off: float = 0.0


@dataclass(frozen=True)
class StationPace:
    """Durations of a station's actions, and its starting point.

    move_s : s, move of 90°, where the drive is not known; dwell_s : s; overhead_s : s, commands of each dwell
    ramp : K/s, of the air; lag : s, time constant of the devices behind the air
    soak_s : s, shortest soak; settled : K, tolerance of a settled device, where the station's rule is not known
    rule, drive : the station's soak rule and table drive; None where not known
    last_dwell_s : s, length of the dwells so far; 0 where equal to ``dwell_s``
    start : pose and chamber temperature of the station; those of the last dwell where None
    rest : s, time since the last dwell
    """

    move_s: float = 5.0
    dwell_s: float = 10.0
    overhead_s: float = 0.5
    ramp: float = 0.05
    lag: float = 150.0
    soak_s: float = 900.0
    settled: float = 0.05
    last_dwell_s: float = 0.0
    start: SequenceStep | None = None
    rest: float = 0.0
    rule: SoakRule | None = None
    drive: Drive | None = None

    @cached_property
    def temperatures(self) -> Air:
        """Ramp and lag as the parameters of the temperature model."""
        return Air(self.ramp, self.lag)

    def turning_s(self, turn: float) -> float:
        """Duration of a move over an angle in rad, s."""
        if self.drive is not None:
            return self.drive.seconds(math.degrees(turn))
        return self.move_s * math.sqrt(turn / (0.5 * math.pi))


@dataclass(frozen=True)
class Timeline:
    """Times and temperatures of steps; times from the end of the dwells before.

    time : (k,), s, middle of each dwell; since_move : (k,), s, from the end of the move to it
    since_on : (k,), s, since the power-on among the steps; infinite where there was none
    device, air : (k,), °C
    grid, grid_device : (m,), s and °C, continuous history
    end : s, end of the last dwell
    """

    time: Array
    since_move: Array
    since_on: Array
    device: Array
    air: Array
    grid: Array
    grid_device: Array
    end: float


def timeline(steps: Sequence[SequenceStep], pace: StationPace, start: SequenceStep | None, device: float) -> Timeline:
    """Times and temperatures of steps.

    Parameters
    ----------
    start : pose and chamber temperature before the first step; the first step's pose, settled, where None
    device : °C, temperature of the devices before the first step
    """
    there = start or replace(steps[0], temperature=device)
    follow = _Follow(there.temperature, device)
    rows: list[tuple[float, float, float, float, float]] = []
    on = -math.inf
    for step in steps:
        turn = max(abs(step.outer - there.outer), abs(step.inner - there.inner))
        if step.temperature != there.temperature and step.soaked:
            follow.soak(step.temperature, pace)
        elif not step.soaked:
            follow.target = step.temperature
        follow.go_on(step.off, pace)
        on = follow.now if step.off > 0.0 else on
        follow.go_on(pace.overhead_s + pace.turning_s(turn), pace)
        follow.go_on(step.wait + 0.5 * pace.dwell_s, pace)
        rows.append((follow.now, step.wait + 0.5 * pace.dwell_s, follow.now - on, follow.device, follow.air))
        follow.go_on(0.5 * pace.dwell_s, pace)
        there = step
    time, since, since_on, devices, air = np.array(rows).T
    return Timeline(time, since, since_on, devices, air, np.array(follow.times), np.array(follow.devices), follow.now)


class _Follow:
    """Air temperature that ramps to its target, and devices that follow with a first-order lag."""

    def __init__(self, air: float, device: float) -> None:
        self.air, self.device, self.target, self.now = air, device, air, 0.0
        self.times, self.devices = [0.0], [device]

    def go_on(self, seconds: float, pace: StationPace) -> None:
        """Advances the time."""
        now, air, device, target = self.now, self.air, self.device, self.target
        end, temperatures = now + max(seconds, 0.0), pace.temperatures
        while now < end - 1e-9:
            moving = abs(target - air) + abs(air - device) > _STILL_K
            grain = min(_GRAIN_S if moving else _LONG_S, end - now)
            air, device = followed(air, device, target, grain, temperatures)
            now += grain
            self.times.append(now)
            self.devices.append(device)
        self.now, self.air, self.device = now, air, device

    def soak(self, target: float, pace: StationPace) -> None:
        """Goes to a temperature and waits until the devices are settled, at least the shortest soak."""
        self.target = target
        if pace.rule is not None:
            waited, _ = soaked(self.air, self.device, target, pace.soak_s, pace.temperatures, pace.rule)
        else:
            waited = max(pace.soak_s, settling_s(self.air, self.device, target, pace.settled, pace.temperatures))
        self.go_on(waited, pace)


def extended(
    state: State, steps: Sequence[SequenceStep], pace: StationPace | None = None, *, response: Array | None = None
) -> State:
    """A state with steps appended after its last dwell.

    Quantities that the steps do not set (supply, vibration, other columns) repeat their values from the first dwell on. Where the
    pace has a start, the steps begin at the end of the history, which includes the time after the last dwell. Otherwise they
    begin after the last dwell, and the history is cut there.

    Parameters
    ----------
    state : of one unit or a lot, (..., n)
    response : (..., 3, 3), g/g, response matrix of the sensors; for states with the force along the sensor axes (``felt``)
    """
    pace = pace or StationPace()
    count = len(steps)
    batch = np.broadcast_shapes(state.force.shape[:-2], state.time.shape[:-1])
    wide = (*batch, count)
    last = None if state.temperature is None else np.broadcast_to(state.temperature, (*batch, n_of(state)))[..., -1]
    middle = T_REFERENCE if last is None else float(np.mean(last))
    apart = np.zeros(batch) if last is None else last - middle
    there = pace.start or standing(state)
    self_heating = _own_heat(state)
    ran = timeline(steps, pace, there, middle - self_heating if pace.start is None else pace.start.temperature)
    apart = apart + self_heating
    outer, inner = np.array([s.outer for s in steps]), np.array([s.inner for s in steps])
    scale = float(np.mean(np.linalg.norm(state.force, axis=-1)))
    force = np.broadcast_to(scale * frames.force_from_angles(outer, inner), (*wide, 3))
    forces = np.concatenate([np.broadcast_to(state.force, (*batch, n_of(state), 3)), force], axis=-2)
    history = state.history if pace.start is not None else _until(state.history, float(np.max(state.time)))
    rest = max(pace.rest, 0.0 if history is None else float(history.time[-1] - np.max(state.time)) - 0.5 * pace.dwell_s)
    passed = rest + 0.5 * pace.dwell_s + ran.time
    begin = np.max(state.time) + rest + 0.5 * pace.dwell_s
    powered = None if state.since_power is None else np.minimum(state.since_power[..., -1:] + passed, ran.since_on)
    off = np.array([s.off for s in steps])
    left: dict[str, Any] = {row.attribute: _repeated(getattr(state, row.attribute), count) for row in LEFT_ALONE}
    return replace(
        state,
        force=forces,
        felt=_felt(state, forces, response),
        output_run=None,
        time=_joined(state.time, np.broadcast_to(begin + ran.time, wide)),
        temperature=_joined_if(state.temperature, apart[..., None] + ran.device),
        chamber=_joined_if(state.chamber, np.broadcast_to(ran.air, wide)),
        since_power=_joined_if(state.since_power, powered),
        power_off=_power_off(state, off, wide),
        since_move=_joined_if(state.since_move, np.broadcast_to(ran.since_move, wide)),
        outer=_joined_if(state.outer, np.broadcast_to(outer, wide)),
        inner=_joined_if(state.inner, np.broadcast_to(inner, wide)),
        covariates={name: _joined(values, _next(values, count)) for name, values in state.covariates.items()},
        history=_history(history, begin + ran.grid, ran.grid_device + apart[..., None]),
        memory={},
        **left,
    )


def _own_heat(state: State) -> float:
    """By how much settled devices are warmer than the air of the chamber, K; zero where that cannot be seen."""
    if state.temperature is None or state.chamber is None or n_of(state) < _ENOUGH:
        return 0.0
    device, air, time = (
        v.reshape(-1, n_of(state)).mean(axis=0) for v in (state.temperature, state.chamber, state.time)
    )
    passed = np.maximum(np.abs(np.diff(time)), 1e-3)
    still = np.abs(np.diff(device)) / passed < _STILL_RATE
    settled = np.append(still, still[-1]) & np.append(True, still)
    return float(np.median((device - air)[settled])) if np.count_nonzero(settled) >= _ENOUGH else 0.0


def standing(state: State) -> SequenceStep | None:
    """Pose and chamber temperature after the last dwell of a state; None where its angles are not known."""
    if state.outer is None or state.inner is None:
        return None
    air = state.chamber if state.chamber is not None else state.temperature
    last = T_REFERENCE if air is None else round(float(np.mean(air[..., -1])), 1)
    return SequenceStep(float(np.mean(state.outer[..., -1])), float(np.mean(state.inner[..., -1])), last)


def n_of(state: State) -> int:
    """Number of dwells of a state."""
    return int(state.force.shape[-2])


def _felt(state: State, force: Array, response: Array | None) -> Array | None:
    if state.felt is None:
        return None
    if response is None:
        return np.concatenate([state.felt, force[..., n_of(state) :, :]], axis=-2)
    return np.einsum("...ij,...nj->...ni", response, force)


def _power_off(state: State, off: Array, wide: tuple[int, ...]) -> Array | None:
    """Time without power before each dwell, s; None where the power was never switched."""
    if state.power_off is None and not np.any(off > 0.0):
        return None
    before = np.zeros(state.time.shape) if state.power_off is None else state.power_off
    return _joined(before, np.broadcast_to(off, wide))


def _history(history: History | None, time: Array, temperature: Array) -> History | None:
    if history is None:
        return None
    lead = history.temperature.shape[:-1]
    more = np.broadcast_to(temperature, (*lead, time.size))
    later = time > history.time[-1]
    return History(
        np.concatenate([history.time, time[later]]), np.concatenate([history.temperature, more[..., later]], axis=-1)
    )


def _until(history: History | None, end: float) -> History | None:
    """A history up to a time, with at least two readings."""
    if history is None or history.time[-1] <= end:
        return history
    count = max(int(np.searchsorted(history.time, end, side="right")), 2)
    return History(history.time[:count], history.temperature[..., :count])


def _joined(values: Array, more: Array) -> Array:
    lead = np.broadcast_shapes(values.shape[:-1], more.shape[:-1])
    both = [np.broadcast_to(v, (*lead, v.shape[-1])) for v in (values, more)]
    return np.concatenate(both, axis=-1)


def _joined_if(values: Array | None, more: Array | None) -> Array | None:
    return None if values is None or more is None else _joined(values, more)


def _repeated(values: Array | None, count: int) -> Array | None:
    return None if values is None else _joined(values, _next(values, count))


def _next(values: Array, count: int) -> Array:
    """The first values of a series repeated, (..., count): quantities that the steps do not set."""
    return np.take(values, np.arange(count) % values.shape[-1], axis=-1)
