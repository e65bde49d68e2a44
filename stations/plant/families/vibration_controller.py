"""The simulated vibration controller with exciter, recorder and reference sensor."""

from __future__ import annotations

import numpy as np

from schemas.profile import Profile
from stations.plant.bench import Waveforms
from stations.plant.result_files import ResultFiles
from stations.plant.world import World

UNKNOWN, WRONG, BUSY = "NA:CMD ERR", "NA:PARA ERR", "NA:BUSY"
STROKE_M, VELOCITY_M_S, ACCELERATION_G = 0.0127, 1.5, 50.0
STANDARD_G = 9.80665
SETTLE_S = 0.5
RANDOM_FINE_HZ, RANDOM_HZ = 25600.0, 12800.0


def simulated(world: World, profile: Profile) -> Controller:
    """A controller in front of the world's bench."""
    return Controller(world, profile)


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
        """The answer to a line, and whether the line changed anything."""
        head, _, value = line.partition(" ")
        if line == "STAT?":
            return self._state(), False
        if line == "FILE?":
            return self._file(), False
        if head in self._set:
            return self._change(head, value)
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

    def _change(self, head: str, value: str) -> tuple[str, bool]:
        if self._world.now_us < self._until_us:
            return BUSY, False
        try:
            self._set[head] = float(value)
        except ValueError:
            return WRONG, False
        return "OK", True

    def _run(self, kind: str) -> tuple[str, bool]:
        world, conditions = self._world, self._world.bench.conditions
        if world.now_us < self._until_us:
            return BUSY, False
        w = 2.0 * np.pi * self._set["FREQ"]
        reach = min(STROKE_M * w**2 / STANDARD_G, VELOCITY_M_S * w / STANDARD_G, ACCELERATION_G)
        self._aborted = ""
        if "controller_abort" in conditions:
            self._aborted = "interlock open"
        elif kind in {"SINE", "ACROSS"} and self._set["LEVEL"] > 1.001 * reach:
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

    def _state(self) -> str:
        if self._aborted:
            return f"ABORT,{self._aborted}"
        return "RUN,-" if self._world.now_us < self._until_us else "DONE,-"

    def _file(self) -> str:
        if not self._kind or self._number == 0 or self._world.now_us < self._until_us:
            return "NONE"
        return self._files.write(self._number, self._recorded, self._world.slots)

    def _recorded(self) -> Waveforms:
        bench, axis, seconds = self._world.bench, int(self._set["AXIS"]), self._set["DUR"]
        tick = self._start_us
        if self._kind in {"SINE", "ACROSS"}:
            angle = self._set["TURN"] if self._kind == "ACROSS" else None
            return bench.sine(self._set["FREQ"], self._set["LEVEL"], axis, seconds, tick, self._conditions, angle)
        return bench.transient(self._random(seconds, tick), axis, tick, RANDOM_FINE_HZ, RANDOM_HZ, self._conditions)

    def _random(self, seconds: float, tick: int) -> np.ndarray:
        """Gaussian vibration along the axis at the fine rate, at rest at both ends."""
        from stations.plant.densities import random_force  # noqa: PLC0415 - read from files when it is needed

        rng = self._world.bench.stream_at(tick, 6)
        share = 0.3 if "level_not_reached" in self._conditions else 1.0
        return random_force(self._density, share * self._set["LEVEL"], seconds, RANDOM_FINE_HZ, rng)
