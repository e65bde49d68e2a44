"""The simulated shock machine with recorder and reference sensor."""

import numpy as np

from schemas.profile import Profile
from stations.plant.bench import FINE_HZ, Waveforms
from stations.plant.equipment import UNKNOWN, ResultFiles, taken
from stations.plant.world import World

REFUSED = "NA:NOT ARMED"
FALL_S = 2.0
BEFORE_S, AFTER_S = 0.06, 0.12
JITTER = 0.03


class Machine:
    """One shock a release; it disarms itself."""

    def __init__(self, world: World, profile: Profile) -> None:
        self._world = world
        self._set = {"PEAK": 50.0, "DUR": 11.0, "AXIS": 2.0, "DIR": 1.0}
        self._armed, self._number, self._start_us, self._until_us = False, 0, 0, 0
        self._recorded_one, self._refused = False, False
        self._shape, self._conditions = (0.0, 0.0), frozenset[str]()
        self._files = ResultFiles()

    def answer(self, line: str) -> tuple[str, bool]:
        head, _, value = line.partition(" ")
        if line.endswith("?"):
            return self._report(line[:-1]), False
        if head in self._set:
            return taken(self._set, head, value)
        if head == "ARM":
            self._armed = value == "ON"
            return "OK", True
        if line == "REL NOW":
            return self._release()
        return UNKNOWN, False

    def _report(self, what: str) -> str:
        world = self._world
        if what == "DOOR":
            return "OPEN" if "guard_door" in world.bench.conditions else "CLOSED"
        if what == "STAT":
            if self._refused:
                return "DOOR"
            return "RUN" if world.now_us < self._until_us else ("ARMED" if self._armed else "READY")
        if what == "FILE":
            done = self._recorded_one and world.now_us >= self._until_us
            return self._files.write(self._number, self._waveforms, world.slots) if done else "NONE"
        return f"{self._set[what]:.6g}" if what in self._set else UNKNOWN

    def _release(self) -> tuple[str, bool]:
        world = self._world
        if not self._armed:
            return REFUSED, False
        self._armed, self._recorded_one = False, False
        self._refused = "guard_door" in world.bench.conditions
        if self._refused:
            return "OK", True
        rng = world.bench.stream_at(world.now_us, 5)
        share = 0.33 if "level_not_reached" in world.bench.conditions else 1.0
        self._shape = (
            share * self._set["PEAK"] * (1.0 + JITTER * float(rng.standard_normal())),
            1e-3 * self._set["DUR"] * (1.0 + JITTER * float(rng.standard_normal())),
        )
        self._start_us, self._conditions = world.now_us, frozenset(world.bench.conditions)
        self._until_us = world.now_us + round(1e6 * FALL_S)
        world.bench.hit(self._shape[0])
        self._recorded_one = "missed_trigger" not in world.bench.conditions
        self._number += self._recorded_one
        return "OK", True

    def _waveforms(self) -> Waveforms:
        peak, duration = self._shape
        t = np.arange(round((BEFORE_S + duration + AFTER_S) * FINE_HZ)) / FINE_HZ - BEFORE_S
        pulse = np.where((t >= 0.0) & (t <= duration), peak * np.sin(np.pi * t / duration), 0.0)
        axis, force = int(self._set["AXIS"]), self._set["DIR"] * pulse
        return self._world.bench.transient(force, axis, self._start_us, conditions=self._conditions)


simulated = Machine
