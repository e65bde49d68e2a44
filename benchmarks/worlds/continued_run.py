"""A run with a blind spot, and everything of it that goes on when it is measured on: noise, ramps, lag of the sensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from noise import Noise, fractional
from physics import PHYSICS
from world import Lot, Scene, World, history_of, left_by_the_plain_model, table_of

Floats = np.ndarray
RAMP = 3.0 / 60.0  # K/s of the air
LAG = 300.0  # s, sensors behind the air
SETTLED = 0.1  # K
HORIZON = 24.0 * 3600.0  # of station time after the run: a proposal may take a day
MOVE = 20.0


@dataclass(frozen=True)
class Blind:
    """A run with a blind spot.

    directions : "faces", "edges" (18), "corners" (26) or "spiral"; shuffled in every turn unless ``one_order``
    effect, size : what is hidden, in RMS that the model leaves of it over the noise of a dwell
    """

    effect: str
    size: float = 4.0
    directions: str = "edges"
    turns: int = 2
    soaks: tuple[float, ...] = (25.0,)
    soak_s: float = 2400.0
    units: int = 8
    noise: Noise = field(default_factory=lambda: Noise(white=25.0, flicker=5.0))
    one_order: bool = False


THREE, UP, AROUND = (-10.0, 60.0, 25.0), (0.0, 20.0, 40.0, 60.0), (25.0, 60.0, -10.0, 20.0)
SCENES: dict[str, Blind] = {
    "cubic on 26": Blind("third_order", directions="corners", turns=1),
    "cubic on 18": Blind("third_order"),
    "cubic on 18, faint": Blind("third_order", 1.0),
    "|f|f on 18": Blind("odd_quadratic"),
    "|f|f on 26, faint": Blind("odd_quadratic", 1.0, "corners"),
    "cubic at 3 temperatures": Blind("third_order", 1.5, "corners", 1, THREE),
    "square on faces": Blind("second_order", 2.0, "faces", 6),
    "|f| on faces": Blind("scale_asymmetry", 2.0, "faces", 6),
    "square on 18, 4 soaks": Blind("second_order", 2.0, "edges", 1, AROUND),
    "T² at 3 temperatures": Blind("bias_temperature_quadratic", 4.0, "edges", 1, THREE),
    "T² at 3, faint": Blind("bias_temperature_quadratic", 1.5, "edges", 1, THREE),
    "T² at 4, up": Blind("bias_temperature_quadratic", 4.0, "faces", 1, UP),
    "T² at 4, around": Blind("bias_temperature_quadratic", 2.0, "faces", 2, AROUND),
    "kink at 4, around": Blind("thermal_kink", 2.0, "faces", 1, AROUND),
    "kink at 4, up": Blind("thermal_kink", 3.0, "faces", 2, UP),
    "T² scale at 3": Blind("scale_temperature_quadratic", 1.0, "edges", 1, THREE),
    "drift": Blind("aging_linear", 3.0, "edges", 4),
    "warm-up": Blind("warm_up", 1.5, "edges", 4),
    "step": Blind("step_change", 1.5, "edges", 3),
    "drift, soaks up": Blind("aging_linear", 2.0, "faces", 2, UP),
    "step, soaks up": Blind("step_change", 2.0, "faces", 2, UP),
    "hysteresis, 4 soaks": Blind("thermal_hysteresis", 2.0, "faces", 2, AROUND),
    "hysteresis, 7 soaks": Blind("thermal_hysteresis", 2.0, "faces", 1, (25.0, 60.0, 40.0, 10.0, -10.0, 10.0, 30.0)),
    "level on faces": Blind("level_error", 3.0, "faces", 6),
    "misalignment over T": Blind("misalignment_temperature", 1.5, "faces", 1, THREE),
    "creep on faces": Blind("creep_after_move", 2.0, "faces", 6, one_order=True),
    "creep on faces, shuffled": Blind("creep_after_move", 2.0, "faces", 6),
    "creep on 18": Blind("creep_after_move", 2.0, "edges", 3, one_order=True),
    "hysteresis, soaks up": Blind("thermal_hysteresis", 2.0, "faces", 2, UP),
    "warm-up, soaks up": Blind("warm_up", 2.0, "faces", 2, UP),
}
"""Sizes and plans at which a diagnosis has more than one name for what is hidden."""


class Continued:
    """A run, and everything of it that goes on when it is measured on."""

    def __init__(self, blind: Blind, seed: int) -> None:
        plan, device, slow, white, hidden = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(5))
        self.blind, self._white, self._readings = blind, white, np.random.default_rng(seed + 1)
        self.steps = _plan(blind, plan)
        self.lot = Lot.drawn(device, blind.units)
        self.tau = LAG * (1.0 + 0.03 * plan.standard_normal(blind.units))
        self.apart = 1.0 + 0.3 * plan.standard_normal((blind.units, 1))
        first = self._scene(self.steps)
        self.count = len(self.steps)
        self._drawn = np.zeros((blind.units, 0, 3))
        end = float(first.start[-1] + first.duration[-1])
        self._slow = _wander(blind.noise, end + HORIZON, blind.units, slow)
        noise = self._noise(first)
        floor = float(np.sqrt(np.mean((noise - noise.mean(axis=1, keepdims=True)) ** 2)))
        drawn = PHYSICS[blind.effect](hidden, blind.units, first)
        left = left_by_the_plain_model(first, np.broadcast_to(drawn(first), first.output.shape))
        size = blind.size * floor / float(np.sqrt(np.mean(left**2)))
        self.effect: Callable[[Any], Floats] = lambda s: size * drawn(s)

    def tables(self, further: list[Step] | None = None, *, quiet: bool = False) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Dwells and temperatures of the run, and of further steps where there are any; ``quiet`` without the noise."""
        scene = self._scene([*self.steps, *(further or [])])
        noise = self._noise(scene)
        output = scene.output + self.effect(scene) + (0.0 if quiet else noise)
        rng = np.random.default_rng([len(scene.start), int(1e6 * self.tau[0])])
        world = World(units=self.blind.units, noise=self.blind.noise)
        readings = scene.temperature + 0.003 * rng.standard_normal(scene.temperature.shape)
        return table_of(world, scene, readings, output, rng), history_of(
            scene, rng, air=np.zeros(self.blind.units, dtype=bool)
        )

    def _noise(self, scene: Scene) -> Floats:
        """Errors of the dwell means, g: those of dwells that were there before stay as they were."""
        n, units = len(scene.start), self.blind.units
        if self._drawn.shape[1] < n:
            more = self._white.standard_normal((units, n - self._drawn.shape[1], 3))
            self._drawn = np.concatenate([self._drawn, more], axis=1)
        white = self.blind.noise.white / np.sqrt(2.0 * scene.duration)
        first = scene.start.astype(int)
        last = np.maximum((scene.start + scene.duration).astype(int), first + 1)
        means = (self._slow[:, last] - self._slow[:, first]) / (last - first)
        return 1e-6 * (self._drawn[:, :n] * white[:, None] + means.reshape(units, 3, n).transpose(0, 2, 1))

    def _scene(self, steps: list[Step]) -> Scene:
        """When and how warm: ramps of the air, sensors that follow, soaks until they have."""
        now, air, target, fine_air = 60.0, steps[0].chamber, steps[0].chamber, [steps[0].chamber] * 12
        body = air
        start: list[float] = []
        for k, step in enumerate(steps):
            if step.chamber != target:
                target, begun = step.chamber, now
                while step.soaked and (now - begun < step.soak_s or abs(body - target) > SETTLED):
                    now, air, body = _tick(now, air, body, target, fine_air)
            moved = k == 0 or (step.outer, step.inner) != (steps[k - 1].outer, steps[k - 1].inner)
            until = now + (MOVE * step.jitter if moved else 1.0) + step.wait
            while now < until:
                now, air, body = _tick(now, air, body, target, fine_air)
            start.append(now)
            until = now + 10.0
            while now < until:
                now, air, body = _tick(now, air, body, target, fine_air)
        fine = 5.0 * np.arange(len(fine_air))
        sensors = np.empty((self.blind.units, fine.size))
        sensors[:, 0] = fine_air[0]
        decay = 1.0 - np.exp(-5.0 / self.tau)
        for k in range(1, fine.size):
            sensors[:, k] = sensors[:, k - 1] + decay * (fine_air[k - 1] - sensors[:, k - 1])
        sensors = sensors + self.apart
        begin = np.array(start)
        middle = begin + 5.0
        own = np.stack([np.interp(middle, fine, one) for one in sensors])
        around = np.broadcast_to(np.interp(middle, fine, fine_air), own.shape)
        n = len(steps)
        scene = Scene(
            np.array([s.outer for s in steps]), np.array([s.inner for s in steps]), begin, np.full(n, 10.0),
            np.array([s.chamber for s in steps]), own, around, np.array([s.wait for s in steps]), fine, sensors,
            np.array(fine_air), 1800.0, *np.zeros((2, self.blind.units, n, 3)),
        )  # fmt: skip
        return self.lot.seen(scene)


@dataclass(frozen=True)
class Step:
    """A dwell of the plan: rad, °C, s."""

    outer: float
    inner: float
    chamber: float
    wait: float = 2.0
    soaked: bool = True
    soak_s: float = 2400.0
    jitter: float = 1.0


def _tick(now: float, air: float, body: float, target: float, fine_air: list[float]) -> tuple[float, float, float]:
    """Five seconds."""
    body += (1.0 - np.exp(-5.0 / LAG)) * (air - body)
    air += float(np.clip(target - air, -5.0 * RAMP, 5.0 * RAMP))
    now += 5.0
    while 5.0 * len(fine_air) <= now + 10.0:
        fine_air.append(air)
    return now, air, body


def _plan(blind: Blind, rng: np.random.Generator) -> list[Step]:
    directions = _directions(blind.directions)
    steps: list[Step] = []
    always = rng.permutation(len(directions)) if blind.one_order else None
    for soak in blind.soaks:
        for _ in range(blind.turns):
            for place in rng.permutation(len(directions)) if always is None else always:
                outer, inner = directions[place]
                steps.append(Step(outer, inner, soak, soak_s=blind.soak_s, jitter=float(rng.uniform(0.7, 1.3))))
    return steps


def _directions(name: str) -> list[tuple[float, float]]:
    """Outer and inner angles, rad, from where up points in the fixture."""
    if name == "spiral":
        k = np.arange(24)
        return list(zip(np.arccos(1.0 - (2.0 * k + 1.0) / 24), 2.39996 * k % (2.0 * np.pi) - np.pi, strict=True))
    signs = np.array(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1])).reshape(3, -1).T
    weight = np.abs(signs).sum(axis=1)
    kept = signs[np.isin(weight, {"faces": [1], "edges": [1, 2], "corners": [1, 2, 3]}[name])]
    up = kept / np.linalg.norm(kept, axis=1, keepdims=True)
    return [(float(np.arccos(z)), float(np.arctan2(x, y))) for x, y, z in up]


def _wander(noise: Noise, seconds: float, units: int, rng: np.random.Generator) -> Floats:
    """Sums of 1/f and walk over a grid of a second, µg·s, (3·units, seconds + 1)."""
    steps = int(seconds) + 2
    slow = np.zeros((3 * units, steps))
    if noise.flicker > 0.0:
        for k in range(3 * units):  # one channel at a time: the record is long
            slow[k] = noise.flicker * fractional(rng, 1, steps)[0]
    if noise.walk > 0.0:
        slow += noise.walk * np.cumsum(rng.standard_normal((3 * units, steps)), axis=1)
    return np.concatenate([np.zeros((3 * units, 1)), np.cumsum(slow, axis=1)], axis=1)
