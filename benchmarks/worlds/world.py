"""A lot on a table in a chamber: plan, devices, what hides in them, and the table of dwells that comes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from faults import FAULTS, Told
from noise import Floats, Noise, dwell_noise
from physics import PHYSICS

RATE_HZ = 100.0
_UNSOAKED = {"device_not_soaked", "unit_not_soaked"}
NDArray = np.ndarray


@dataclass(frozen=True)
class World:
    """A run to be made.

    durations : shortest and longest dwell, s; fresh_noise : of the fresh run, where its day has another noise
    hidden : (effect, size), size = RMS that the plain model leaves of it over the noise of a dwell
    fault, amount : what goes wrong and by how much
    floors : the amount in place of ``amount``, over the RMS noise of a dwell about the mean of its record, for faults in mg
    beside : further faults and their amounts
    rest : RMS of the table's rest position, µrad, alike for all; lsb : resolution over the noise of a dwell's samples
    differ : factor on what the units differ by in bias and response
    turn_on : RMS of the bias shift between the run and the fresh one, µg; unsoaked : dwells begin when the chamber arrives
    ramps : nothing soaks: from a room at 23 °C the chamber goes to each temperature in turn while the table goes on
    """

    units: int = 8
    poses: int = 24
    soaks: tuple[float, ...] = (-10.0, 25.0, 60.0)
    durations: tuple[float, float] = (10.0, 10.0)
    noise: Noise = field(default_factory=Noise)
    fresh_noise: Noise | None = None
    hidden: tuple[tuple[str, float], ...] = ()
    fault: str = ""
    amount: float = 0.0
    floors: float = 0.0
    beside: tuple[tuple[str, float], ...] = ()
    rest: float = 0.0
    lsb: float = 0.0
    differ: float = 1.0
    turn_on: float = 0.0
    repeats: int = 1
    hours: float = 2.5
    ramps: bool = False


@dataclass(frozen=True)
class Scene:
    """What all of a run's physics may look at; (n,) or (units, n).

    start, duration : of each dwell, s; soak : its place in the plan
    temperature : true, of the sensors; chamber : air
    output : (units, n, 3), g, of the devices without noise and without what is hidden; along : force along their axes
    """

    outer: Floats
    inner: Floats
    start: Floats
    duration: Floats
    soak: NDArray
    temperature: Floats
    chamber: Floats
    wait: Floats
    fine: Floats
    fine_temperature: Floats
    fine_air: Floats
    powered: float
    output: Floats
    along: Floats

    @property
    def force(self) -> Floats:
        """Specific force in the fixture, (n, 3), g: (Rx(outer)·Rz(inner))ᵀ·up."""
        return force_of(self.outer, self.inner)


@dataclass(frozen=True)
class Made:
    """The tables of a run and of a fresh one, with what was done to the first."""

    dwells: pd.DataFrame
    history: pd.DataFrame
    fresh: pd.DataFrame
    fresh_history: pd.DataFrame
    faults: tuple[Told, ...]
    floor_ug: float

    @property
    def told(self) -> Told | None:
        """The fault, or the first of them."""
        return self.faults[0] if self.faults else None


def force_of(outer: Floats, inner: Floats) -> Floats:
    """Where up is in the fixture, (..., 3)."""
    return np.stack([np.sin(outer) * np.sin(inner), np.sin(outer) * np.cos(inner), np.cos(outer)], axis=-1)


def make(world: World, seed: int) -> Made:
    """The tables of a world; the same seed gives the same bytes."""
    plan, device, first, second, third = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(5))
    scene = _scene(world, plan, first)
    lot = Lot.drawn(device, world.units, world.differ)
    scene, again = (lot.seen(s) for s in (scene, _with_heat(scene, world, second)))
    noises = [
        1e-6 * dwell_noise(noise, s.start, s.duration, world.units, g, s.temperature.mean(axis=0))
        for noise, s, g in ((world.noise, scene, first), (world.fresh_noise or world.noise, again, second))
    ]
    floor = float(np.sqrt(np.mean((noises[0] - noises[0].mean(axis=1, keepdims=True)) ** 2)))
    extra = _hidden(world, scene, again, floor, third)
    told: tuple[Told, ...] = ()
    tables = []
    shift = 1e-6 * world.turn_on * second.standard_normal((world.units, 1, 3))
    for k, (s, drawn, rng) in enumerate(((scene, noises[0], first), (again, noises[1], second))):
        rest = 1e-6 * world.rest * rng.standard_normal((2, len(s.start)))
        true = replace(s, outer=s.outer + rest[0], inner=s.inner + rest[1])
        noise, turned, readings = drawn, None, s.temperature + 0.003 * rng.standard_normal(s.temperature.shape)
        if k == 0:
            own = 1e3 * world.floors * floor if world.floors else world.amount
            for fault, amount in ((world.fault, own), *world.beside) if world.fault else ():
                true, more, readings, noise, one = FAULTS[fault](true, readings, noise, amount, third)
                turned = more if turned is None else turned if more is None else turned + more
                told += one if isinstance(one, tuple) else () if one is None else (one,)
        output = lot.output(true, turned) + extra[k] + noise + k * shift
        tables.append((table_of(world, s, readings, output, rng), history_of(s, rng, air=_of_air(world, told))))
    return Made(tables[0][0], tables[0][1], tables[1][0], tables[1][1], told, 1e6 * floor)


def _of_air(world: World, told: tuple[Told, ...]) -> NDArray:
    """Which units have the chamber's air in place of their own temperature, (units,)."""
    whole = [not t.units for t in told if set(t.names) & _UNSOAKED] or [False]
    own = {u for t in told if set(t.names) & _UNSOAKED for u in t.units}
    return np.array([any(whole) or f"W{unit + 1:03d}" in own for unit in range(world.units)])


@dataclass(frozen=True)
class Lot:
    """Devices: bias, response, and their slopes over temperature."""

    bias: Floats
    matrix: Floats
    bias_tempco: Floats
    scale_tempco: Floats

    @staticmethod
    def drawn(rng: np.random.Generator, units: int, differ: float = 1.0) -> Lot:
        """Devices of one make."""
        matrix = np.eye(3) + 3e-3 * differ * rng.standard_normal((units, 3, 3))
        return Lot(
            0.02 * differ * rng.standard_normal((units, 3)),
            matrix,
            50e-6 * (rng.standard_normal(3) + 0.6 * rng.standard_normal((units, 3))),
            80e-6 * (1.0 + 0.4 * rng.standard_normal((units, 3))),
        )

    def output(self, scene: Scene, turned: Floats | None = None) -> Floats:
        """Outputs (units, n, 3), g; ``turned`` (units, n, 3) is a small rotation of each unit."""
        force = np.broadcast_to(scene.force, (len(self.bias), len(scene.start), 3))
        if turned is not None:
            force = force + np.cross(turned, force)
        warm = (scene.temperature - 25.0)[..., None]
        # warmth changes the gain of an axis, not where the axis points
        gain = 1.0 + warm * self.scale_tempco[:, None]
        return self.bias[:, None] + warm * self.bias_tempco[:, None] + gain * self._along(force)

    def seen(self, scene: Scene) -> Scene:
        """The scene with what the devices make of it."""
        force = np.broadcast_to(scene.force, (len(self.bias), len(scene.start), 3))
        return replace(scene, output=self.output(scene), along=self._along(force))

    def _along(self, force: Floats) -> Floats:
        return np.einsum("uij,unj->uni", self.matrix, force)


def _scene(world: World, rng: np.random.Generator, heat: np.random.Generator) -> Scene:
    count = world.poses * world.repeats
    z = 1.0 - 2.0 * (np.arange(world.poses) + 0.5) / world.poses
    spiral = np.arange(world.poses) * np.pi * (3.0 - np.sqrt(5.0)) + rng.uniform(0.0, 2.0 * np.pi)
    tilt, turn = np.arccos(z), np.angle(np.exp(1j * spiral))
    moves = 20.0
    low, high = world.durations
    soaks = len(world.soaks)
    duration = (
        np.exp(rng.uniform(np.log(low), np.log(high), count * soaks)) if high > low else np.full(count * soaks, low)
    )
    span = float(np.sum(duration) + moves * count * soaks)
    rest = max((3600.0 * world.hours - span) / max(soaks - 1, 1), 600.0) if soaks > 1 and not world.ramps else 0.0
    start, outer, inner, place, wait = [], [], [], [], []
    now, k = 60.0, 0
    for soak in range(soaks):
        order = np.concatenate([rng.permutation(world.poses) for _ in range(world.repeats)])
        for p in order:
            pause = moves * rng.uniform(0.7, 1.3)
            now += pause
            start.append(now)
            outer.append(tilt[p])
            inner.append(turn[p])
            place.append(soak)
            wait.append(pause - 8.0)
            now += duration[k]
            k += 1
        now += rest
    empty = np.zeros((world.units, 0))
    scene = Scene(
        np.array(outer), np.array(inner), np.array(start), duration, np.array(place), empty, empty, np.array(wait),
        np.zeros(0), empty, np.zeros(0), 1800.0, empty, empty,
    )  # fmt: skip
    return _with_heat(scene, world, heat)


def _with_heat(scene: Scene, world: World, rng: np.random.Generator) -> Scene:
    """The scene with air and sensors at their temperatures: the air ramps at once after a soak, the sensors lag by 300 s."""
    fine = np.arange(0.0, scene.start[-1] + scene.duration[-1] + 10.0, 5.0)
    arrives = [scene.start[scene.soak == s][0] for s in range(len(world.soaks))]
    ends = [(scene.start + scene.duration)[scene.soak == s][-1] for s in range(len(world.soaks))]
    air = _ramped(fine, ends, world.soaks) if world.ramps else np.full(fine.size, world.soaks[0])
    for s in range(1, 0 if world.ramps else len(world.soaks)):
        ramp = 60.0 * abs(world.soaks[s] - world.soaks[s - 1]) / 3.0  # 3 K/min
        begin = (
            arrives[s] - ramp - 30.0 if world.fault.endswith("unsoaked") else min(ends[s - 1] + 5.0, arrives[s] - 30.0)
        )
        gone = np.clip((fine - begin) / ramp, 0.0, 1.0)
        air = np.where(fine >= begin, world.soaks[s - 1] + gone * (world.soaks[s] - world.soaks[s - 1]), air)
    tau = 300.0 * (1.0 + 0.03 * rng.standard_normal(world.units))[:, None]
    body = np.empty((world.units, fine.size))
    body[:, 0] = air[0]
    decay = 1.0 - np.exp(-5.0 / tau[:, 0])
    for k in range(1, fine.size):
        body[:, k] = body[:, k - 1] + decay * (air[k - 1] - body[:, k - 1])
    body = body + 1.0 + 0.3 * rng.standard_normal((world.units, 1))
    middle = scene.start + 0.5 * scene.duration
    own = np.stack([np.interp(middle, fine, b) for b in body])
    around = np.broadcast_to(np.interp(middle, fine, air), own.shape)
    return replace(scene, temperature=own, chamber=around, fine=fine, fine_temperature=body, fine_air=air)


def _ramped(fine: Floats, ends: list[float], goals: tuple[float, ...]) -> Floats:
    """The air of a chamber that goes from a room at 23 °C to each goal in turn, at 3 K/min, after the dwells before."""
    air, now = np.empty(fine.size), 23.0
    step = 3.0 / 60.0 * (fine[1] - fine[0])
    for k, time in enumerate(fine):
        goal = goals[min(int(np.searchsorted(ends, time)), len(goals) - 1)]
        now += float(np.clip(goal - now, -step, step))
        air[k] = now
    return air


def _hidden(world: World, scene: Scene, again: Scene, floor: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """What the hidden effects add to the run and to the fresh one, (units, n, 3), g."""
    added = [np.zeros((world.units, len(scene.start), 3)) for _ in range(2)]
    for name, size in world.hidden:
        physics: Callable[..., Callable[[Scene], Floats]] = PHYSICS[name]
        effect = physics(rng, world.units, scene)
        shape = effect(scene)
        left = float(np.sqrt(np.mean(left_by_the_plain_model(scene, shape) ** 2)))
        factor = size * floor / left
        added = [f + factor * effect(s) for f, s in zip(added, (scene, again), strict=True)]
    return added[0], added[1]


def left_by_the_plain_model(scene: Scene, shape: Floats) -> Floats:
    """What bias, scale, misalignment and (over temperature) the runs of bias and scale leave of an effect, (units, n, 3)."""
    out = np.empty_like(shape)
    for unit in range(len(shape)):
        warm = scene.temperature[unit] - 25.0
        for axis in range(3):
            columns = [np.ones(len(warm)), *scene.force.T]
            columns += [warm, warm * scene.along[unit, :, axis]] if np.ptp(warm) > 5.0 else []
            x = np.stack(columns, axis=-1)
            out[unit, :, axis] = shape[unit, :, axis] - x @ np.linalg.lstsq(x, shape[unit, :, axis], rcond=None)[0]
    return out


def table_of(world: World, scene: Scene, readings: Floats, output: Floats, rng: np.random.Generator) -> pd.DataFrame:
    units, n = readings.shape
    samples = np.maximum((scene.duration * RATE_HZ).astype(int), 2)
    white = 1e-6 * world.noise.white * np.sqrt(RATE_HZ / 2.0) * world.noise.factors(units)
    white = white * np.resize(world.noise.unit_white, units)[:, None]
    spread = white[:, None] * np.sqrt(rng.chisquare(samples - 1, (3, units, n)) / (samples - 1)).transpose(1, 2, 0)
    if world.lsb > 0.0:
        output, spread = _quantised(output, white, world.lsb, samples, rng)
    rows = []
    for unit in range(units):
        table = pd.DataFrame(output[unit], columns=["out_x", "out_y", "out_z"])
        table.insert(0, "unit", f"W{unit + 1:03d}")
        table.insert(1, "dwell", np.arange(n))
        table.insert(2, "time_s", scene.start + 0.5 * scene.duration)
        table[["sd_x", "sd_y", "sd_z"]] = spread[unit]
        rows.append(table.assign(
            outer_deg=np.degrees(scene.outer), inner_deg=np.degrees(scene.inner), n=samples, duration_s=scene.duration,
            unit_C=readings[unit], chamber_C=scene.chamber[unit], since_move_s=scene.wait,
            since_power_s=scene.powered + scene.start,
        ))  # fmt: skip
    return pd.concat(rows, ignore_index=True)


def _quantised(
    output: Floats, white: Floats, lsb: float, samples: NDArray, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Means and spreads of samples rounded to a step of ``lsb`` standard deviations of the noise of a sample."""
    step = lsb * white[:, None]
    mean, spread = np.empty_like(output), np.empty_like(output)
    for k, count in enumerate(samples.tolist()):
        drawn = output[:, k, None] + white[:, None] * rng.standard_normal((output.shape[0], count, 3))
        rounded = step * np.round(drawn / step)
        mean[:, k], spread[:, k] = rounded.mean(axis=1), rounded.std(axis=1, ddof=1)
    return mean, spread


def history_of(scene: Scene, rng: np.random.Generator, *, air: NDArray) -> pd.DataFrame:
    """The units' temperatures against time; the chamber's air in the units (units,) of which nothing else is read."""
    every = slice(None, None, 6)
    rows = [
        pd.DataFrame({
            "unit": f"W{unit + 1:03d}", "time_s": scene.fine[every],
            "unit_C": (scene.fine_air + 1.0 if air[unit] else body)[every] + 0.003 * rng.standard_normal(scene.fine[every].size),
        })
        for unit, body in enumerate(scene.fine_temperature)
    ]  # fmt: skip
    return pd.concat(rows, ignore_index=True)
