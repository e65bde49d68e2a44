"""A day on the station: the path of the table, the chamber and the rooms' weather on one grid of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Floats = NDArray[np.float64]
STEP_S = 3.0
WAYPOINTS = 12


@dataclass(frozen=True)
class Plan:
    """What is the same on every day of a lot; drawn from its seed."""

    angles: Floats  # (poses, 2), outer and inner, rad
    temperatures: Floats  # (soaks,), °C, in order of measurement
    shuffled: bool  # whether every soak has an order of poses of its own
    duration_s: float
    settle_s: float
    patience: float  # how much longer the wait after a move may be, drawn anew for each
    speed: float  # rad/s
    soak_taus: float  # wait after a ramp, in multiples of the slowest unit's time constant
    ramp: float  # K/s
    power_on_s: float  # before the first dwell
    taus: Floats  # (units,), s
    offsets: Floats  # (units,), K from the chamber's air, at most
    columns: str  # 'force', 'angles' or 'both'
    history: bool
    weather: bool  # room and barometer are recorded
    supply_wander: float  # V

    @property
    def thermal(self) -> bool:
        """Whether the plan has temperatures far enough apart for coefficients of temperature."""
        return float(np.ptp(self.temperatures)) > 5.0


def draw_plan(rng: np.random.Generator, units: int, needs: frozenset[str]) -> Plan:
    """A plan with what a kind of world needs: 'soaks', 'return', 'short' soaks, 'cold' start, 'supply', 'weather', 'history'."""
    angles = _poses(rng)
    single = rng.random() < 0.2 and not needs & {"soaks", "return", "short"}
    count = int(rng.integers(3, 6))
    low, high = rng.uniform(-40.0, 5.0), rng.uniform(50.0, 85.0)
    up = np.linspace(low, high, count) + rng.uniform(-4.0, 4.0, count)
    way = str(rng.choice(["up", "down", "random", "return"]))
    if "return" in needs:
        way = "return"
    if single:
        temperatures = np.full(1, rng.uniform(20.0, 35.0))
    elif way == "return":
        temperatures = np.concatenate([up[:-1][-3:], up[-1:], up[-2::-1][:3] + rng.uniform(-3.0, 3.0)])
    else:
        temperatures = {"up": up, "down": up[::-1], "random": rng.permutation(up)}[way]
    if single:
        angles = np.tile(angles, (max(2, round(55 / len(angles))), 1))
    return Plan(
        angles=angles,
        temperatures=temperatures,
        shuffled=bool(rng.random() < 0.5),
        duration_s=STEP_S * int(rng.integers(7, 25)),
        settle_s=float(rng.uniform(8.0, 40.0)),
        patience=float(rng.choice([0.0, 0.3, 3.0])),
        speed=float(np.deg2rad(rng.uniform(8.0, 30.0))),
        soak_taus=float(rng.uniform(1.2, 2.2) if "short" in needs else rng.uniform(5.0, 7.0)),
        ramp=float(rng.uniform(1.0, 4.0)) / 60.0,
        power_on_s=float(rng.uniform(120.0, 500.0) if "cold" in needs else rng.uniform(1800.0, 20000.0)),
        taus=rng.uniform(250.0, 700.0) * rng.uniform(0.85, 1.15, units),
        offsets=rng.normal(0.0, 0.3, units),
        columns=str(rng.choice(["force", "angles", "both"])),
        history=bool("history" in needs or rng.random() < 0.75),
        weather=bool(rng.random() < (0.7 if "weather" in needs else 0.25)),
        supply_wander=float(rng.uniform(0.015, 0.06) if "supply" in needs else rng.uniform(1e-4, 8e-4)),
    )


def _poses(rng: np.random.Generator) -> Floats:
    """Outer and inner angles (poses, 2), rad: a sphere, faces and edges, or tumbles at several headings."""
    style = rng.choice(["sphere", "edges", "tumble"])
    if style == "sphere":
        count = int(rng.integers(16, 30))
        height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
        turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0)) + rng.uniform(0.0, 2.0 * np.pi)
        angles = np.stack([np.arccos(height), turn], axis=1)
    elif style == "edges":
        grid = [(a, b) for a in (0, 45, 90, 135, 180) for b in (0, 45, 90, 135, 180, 225, 270, 315)]
        grid = [(a, b) for a, b in grid if (a % 180 and not ((a // 45) % 2 and (b // 45) % 2)) or not b]
        angles = np.deg2rad(np.array(grid, dtype=float))
    else:
        step = int(rng.choice([30, 40]))
        headings = rng.choice([[0, 90], [0, 45, 90], [-60, 0, 60]][int(rng.integers(1, 3))], size=3, replace=False)
        angles = np.deg2rad(np.array([(a, b) for b in sorted(headings) for a in range(-180 + step, 181, step)], float))
    wrapped = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped[rng.permutation(len(wrapped))] if rng.random() < 0.5 else wrapped


def force_of(outer: Floats, inner: Floats) -> Floats:
    """Specific force (…, 3) on the fixture, g: the outer axis lies along the laboratory's x, the inner is the fixture's z."""
    return np.stack([np.sin(inner) * np.sin(outer), np.cos(inner) * np.sin(outer), np.cos(outer)], axis=-1)


@dataclass(frozen=True)
class Day:
    """One day's run of a plan; n instants, d dwells, u units."""

    plan: Plan
    t: Floats  # (n,), s
    windows: NDArray[np.intp]  # (d, k), instants inside each dwell
    soak: NDArray[np.intp]  # (d,)
    angles: Floats  # (d, 2), rad
    way: Floats  # (d, waypoints, 2), rad: how the table came to each pose
    path: Floats  # (n, 2), rad
    since_move: Floats  # (d,), s, at the middle of the dwell
    chamber: Floats  # (n,), °C
    case: Floats  # (n, u), °C: what the thermometers of the units measure
    compressor: NDArray[np.bool_]  # (n,)
    supply: Floats  # (n,), V
    room: Floats  # (n,), °C
    pressure: Floats  # (n,), hPa

    def mean(self, values: Floats) -> Floats:
        """Means (d, …) over the dwells of values (n, …)."""
        return values[self.windows].mean(axis=1)

    @property
    def force(self) -> Floats:
        """Specific force (d, 3) that the commanded angles mean, g."""
        return force_of(self.angles[:, 0], self.angles[:, 1])


def draw_day(rng: np.random.Generator, plan: Plan) -> Day:
    """A run of the plan with weather of its own."""
    clock, target, rows, place = plan.power_on_s, [(0.0, plan.temperatures[0])], [], plan.angles[0]
    for soak, temperature in enumerate(plan.temperatures):
        before = plan.temperatures[soak - 1] if soak else temperature
        target.append((clock if soak else 0.0, temperature))
        clock += abs(temperature - before) / plan.ramp + (plan.soak_taus * float(plan.taus.max()) if soak else 0.0)
        order = rng.permutation(len(plan.angles)) if plan.shuffled else np.arange(len(plan.angles))
        for pose in order:
            seconds = float(np.abs(plan.angles[pose] - place).max()) / plan.speed
            arrival = clock + seconds
            start = arrival + plan.settle_s * (1.0 + plan.patience * rng.random())
            rows.append((soak, pose, clock, arrival, start))
            clock, place = start + plan.duration_s + STEP_S + 1.0, plan.angles[pose]
    t = np.arange(0.0, clock + 2.0 * STEP_S, STEP_S)
    soaks, poses, leave, arrival, start = (np.array(column) for column in zip(*rows, strict=True))
    angles = plan.angles[poses.astype(int)]
    before = np.concatenate([angles[:1], angles[:-1]])
    knots = np.stack([leave, arrival], axis=1).ravel() + np.tile([0.0, 1e-3], len(leave))
    turns = np.stack([before, angles], axis=1).reshape(-1, 2)
    path = np.stack([np.interp(t, knots, turns[:, axis]) for axis in (0, 1)], axis=1)
    part = np.linspace(0.0, 1.0, WAYPOINTS)[None, :, None]
    first = np.ceil(start / STEP_S).astype(int)
    windows = first[:, None] + np.arange(round(plan.duration_s / STEP_S))[None, :]
    chamber, case, compressor = _heat(rng, plan, t, target)
    day_s, phase = 86400.0, rng.uniform(0.0, 2.0 * np.pi)
    room = 22.0 + rng.uniform(0.6, 2.0) * np.sin(2.0 * np.pi * t / day_s + phase) + 0.25 * _wander(rng, t.size, 2400.0)
    return Day(
        plan, t, windows, soaks.astype(int), angles,
        before[:, None, :] + part * (angles - before)[:, None, :], path,
        t[windows].mean(axis=1) - arrival, chamber, case, compressor,
        3.3 + plan.supply_wander * (_wander(rng, t.size, 5000.0) + 0.5 * _wander(rng, t.size, 500.0)),
        room, rng.uniform(985.0, 1025.0) + rng.uniform(2.0, 5.0) * _wander(rng, t.size, 30000.0),
    )  # fmt: skip


def _wander(rng: np.random.Generator, count: int, seconds: float) -> Floats:
    """A relaxation process (n,) of unit variance with this time constant."""
    keep = np.exp(-STEP_S / seconds)
    steps = rng.standard_normal(count) * np.sqrt(1.0 - keep**2)
    return lfilter([1.0], [1.0, -keep], steps, zi=[keep * rng.standard_normal()])[0]


def _heat(
    rng: np.random.Generator, plan: Plan, t: Floats, target: list[tuple[float, float]]
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Air (n,), units (n, u) and whether the compressor runs (n,)."""
    times, values, last = [0.0], [target[0][1]], target[0][1]
    for at, temperature in target[1:]:
        times += [max(at, times[-1] + 1.0), max(at, times[-1] + 1.0) + abs(temperature - last) / plan.ramp + 1.0]
        values += [last, temperature]
        last = temperature
    cycle = 0.15 * np.sin(2.0 * np.pi * t / rng.uniform(90.0, 400.0))
    wanted = np.interp(t, times, values)
    air = _follow(wanted, 120.0) + 0.05 * _wander(rng, t.size, 600.0)
    duty = np.clip(0.55 - (wanted - 25.0) / 120.0, 0.15, 0.95)
    compressor = ((t + rng.uniform(0.0, 900.0)) / 900.0) % 1.0 < duty
    gradient = plan.offsets * (wanted[:, None] - 22.0) / 40.0
    case = np.stack([_follow(air + cycle + gradient[:, unit], tau) for unit, tau in enumerate(plan.taus)], axis=1)
    return air + cycle, case, compressor


def _follow(values: Floats, tau: float) -> Floats:
    """A first-order lag behind values (n,), at rest with them at the start."""
    keep = np.exp(-STEP_S / tau)
    return lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0]
