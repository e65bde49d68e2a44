"""The simulated vibration controller with exciter, recorder and reference sensor."""

import numpy as np
from numpy.typing import NDArray

from schemas.profile import Profile
from schemas.vibration_profile import load_vibration_profile
from stations.plant.bench import Waveforms
from stations.plant.equipment import UNKNOWN, ResultFiles, exciter_reach, taken
from stations.plant.world import World

BUSY = "NA:BUSY"
SETTLE_S = 0.5
RANDOM_FINE_HZ, RANDOM_HZ = 25600.0, 12800.0
REST_S, RAMP_S = 1.0, 0.05

Array = NDArray[np.float64]


class Controller:
    """Runs finite tests; a test that is not ended is over after its duration."""

    def __init__(self, world: World, profile: Profile) -> None:
        self._world, self._profile = world, profile
        self._set = {"FREQ": 160.0, "LEVEL": 1.0, "DUR": 1.0, "AXIS": 2.0, "TURN": 0.0}
        self._density = "flat_20_2000"
        self._kind, self._start_us, self._until_us, self._number = "", 0, 0, 0
        self._aborted, self._conditions = "", frozenset[str]()
        self._files = ResultFiles()

    def answer(self, line: str) -> tuple[str, bool]:  # noqa: PLR0911 - one return an order
        head, _, value = line.partition(" ")
        if line == "STAT?":
            state = "RUN,-" if self._world.now_us < self._until_us else "DONE,-"
            return (f"ABORT,{self._aborted}" if self._aborted else state), False
        if line == "FILE?":
            done = self._kind and self._number and self._world.now_us >= self._until_us
            return (self._files.write(self._number, self._recorded, self._world.slots) if done else "NONE"), False
        if head in self._set:
            return (BUSY, False) if self._world.now_us < self._until_us else taken(self._set, head, value)
        if head == "PROFILE":
            self._density = value
            return "OK", True
        if head == "RUN":
            return self._run(value)
        if line == "STOP NOW":
            self._until_us = min(self._until_us, self._world.now_us)
            self._kind = "" if self._world.now_us < self._until_us else self._kind
            return "OK", True
        if line.endswith("?") and line[:-1] in self._set:
            return f"{self._set[line[:-1]]:.7g}", False
        return UNKNOWN, False

    def _run(self, kind: str) -> tuple[str, bool]:
        world, conditions = self._world, self._world.bench.conditions
        if world.now_us < self._until_us:
            return BUSY, False
        self._aborted = ""
        if "controller_abort" in conditions:
            self._aborted = "interlock open"
        elif kind in {"SINE", "ACROSS"} and self._set["LEVEL"] > 1.001 * exciter_reach(self._set["FREQ"]):
            self._aborted = "limit of stroke velocity or acceleration"
        if self._aborted:
            return "OK", True
        self._kind, self._start_us, self._conditions = kind, world.now_us, frozenset(conditions)
        self._until_us = world.now_us + round(1e6 * (self._set["DUR"] + SETTLE_S))
        if "missed_trigger" in conditions:
            self._kind = ""
        else:
            self._number += 1
        return "OK", True

    def _recorded(self) -> Waveforms:
        bench, axis, seconds = self._world.bench, int(self._set["AXIS"]), self._set["DUR"]
        tick = self._start_us
        if self._kind in {"SINE", "ACROSS"}:
            angle = self._set["TURN"] if self._kind == "ACROSS" else None
            return bench.sine(self._set["FREQ"], self._set["LEVEL"], axis, seconds, tick, self._conditions, angle)
        level = (0.3 if "level_not_reached" in self._conditions else 1.0) * self._set["LEVEL"]
        force = random_force(self._density, level, seconds, RANDOM_FINE_HZ, bench.stream_at(tick, 6))
        return bench.transient(force, axis, tick, RANDOM_FINE_HZ, RANDOM_HZ, self._conditions)


simulated = Controller


def random_force(profile: str, level_g: float, seconds: float, rate_hz: float, rng: np.random.Generator) -> Array:
    """Force (n,) in g: rest, ``seconds`` of vibration of this overall level with short ramps, rest."""
    points = np.array(load_vibration_profile(profile).breakpoints)
    count = round(seconds * rate_hz)
    f = np.fft.rfftfreq(count, 1.0 / rate_hz)
    inside = (f >= points[0, 0]) & (f <= points[-1, 0])
    density = np.zeros_like(f)
    density[inside] = np.exp(np.interp(np.log(f[inside]), np.log(points[:, 0]), np.log(points[:, 1])))
    z = rng.standard_normal((2, f.size))
    wave = np.fft.irfft(np.sqrt(density) * (z[0] + 1j * z[1]), count)
    wave *= level_g / float(np.sqrt(np.mean(wave**2)))
    ramp = np.minimum(1.0, np.minimum(np.arange(count), np.arange(count)[::-1]) / (RAMP_S * rate_hz))
    rest = np.zeros(round(REST_S * rate_hz))
    return np.concatenate([rest, wave * ramp, rest])
