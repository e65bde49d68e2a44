"""The simulated generator with recorder, before an exciter with its amplifier, or at the self-test inputs of the devices."""

import math

from schemas.profile import Profile
from stations.plant.bench import Waveforms
from stations.plant.equipment import DONE, UNDEFINED, ResultFiles, ScpiDevice, exciter_reach
from stations.plant.world import World

SETTLE_S = 0.3
MOST_V = 10.0
GAIN_G_V, SUSPENSION_HZ, SUSPENSION_DAMPING = 10.0, 12.0, 0.4
NUMBERS = {
    "SOUR1:FREQ": (1e-3, 2e4),
    "SOUR1:VOLT": (0.0, MOST_V),
    "SOUR1:BURS:NCYC": (1.0, 1e7),
    "ACQ:LENG": (1e-4, 600.0),
    "ACQ:BEF": (0.0, 600.0),
    "ROUT:AXIS": (0.0, 2.0),
}


def exciter_gain(frequency: float) -> float:
    """Acceleration over the amplifier's input, g/V: a mass on its suspension above the suspension's resonance."""
    r2 = (frequency / SUSPENSION_HZ) ** 2
    return GAIN_G_V * r2 / math.hypot(1.0 - r2, 2.0 * SUSPENSION_DAMPING * math.sqrt(r2))


class Generator(ScpiDevice):
    """Finite bursts; a burst that is not ended is over after its cycles."""

    def __init__(self, world: World, profile: Profile) -> None:
        super().__init__()
        self._world, self._steps = world, profile.kind == "step_generator"
        self._set = {
            "SOUR1:FREQ": 160.0, "SOUR1:VOLT": 0.0, "SOUR1:BURS:NCYC": 1.0, "ACQ:LENG": 0.1, "ACQ:BEF": 0.0, "ROUT:AXIS": 2.0,
        }  # fmt: skip
        self._function, self._on = "SIN", False
        self._number, self._start_us, self._until_us, self._fault = 0, 0, 0, False
        self._there, self._conditions = False, frozenset[str]()
        self._files = ResultFiles()

    def answer(self, line: str) -> tuple[str, bool]:
        if line.endswith("?") and not line.endswith(";*OPC?"):
            return self._report(line[:-1])
        head, _, value = line.removesuffix(";*OPC?").partition(" ")
        if head in NUMBERS:
            self._set[head] = self.ordered(value, *NUMBERS[head], self._set[head])
        elif head == "SOUR1:FUNC" and value in {"SIN", "SQU"}:
            self._function = value
        elif head == "OUTP1" and value in {"ON", "OFF"}:
            self._on = value == "ON"
            if not self._on:
                self._until_us = min(self._until_us, self._world.now_us)
        elif head == "INIT":
            self._begin()
        else:
            self.error = UNDEFINED
        return DONE, True

    def _report(self, head: str) -> tuple[str, bool]:
        world = self._world
        if head == "SYST:ERR":
            return self.told_error()
        if head == "ACQ:STAT":
            return ("FAULT" if self._fault else "RUN" if world.now_us < self._until_us else "DONE"), False
        if head == "ACQ:FILE":
            done = self._there and world.now_us >= self._until_us
            unit = "V" if self._steps else "g"
            return (self._files.write(self._number, self._recorded, world.slots, unit) if done else "NONE"), False
        texts = {"SOUR1:FUNC": self._function, "OUTP1": str(int(self._on))}
        return (f"{self._set[head]:.7g}" if head in self._set else texts.get(head, "")), False

    def _level(self) -> float:
        return exciter_gain(self._set["SOUR1:FREQ"]) * self._set["SOUR1:VOLT"]

    def _begin(self) -> None:
        world, conditions = self._world, self._world.bench.conditions
        too_far = not self._steps and self._level() > exciter_reach(self._set["SOUR1:FREQ"])
        self._fault = "controller_abort" in conditions or too_far
        self._there = self._on and not self._fault and "missed_trigger" not in conditions
        if self._fault:
            return
        self._start_us, self._conditions = world.now_us, frozenset(conditions)
        self._until_us = world.now_us + round(1e6 * (self._set["ACQ:LENG"] + SETTLE_S))
        self._number += self._there

    def _recorded(self) -> Waveforms:
        bench, seconds = self._world.bench, self._set["ACQ:LENG"]
        if self._steps:
            volts, hold, before = self._set["SOUR1:VOLT"], 0.5 / self._set["SOUR1:FREQ"], self._set["ACQ:BEF"]
            return bench.self_test(volts, hold, before, seconds, self._start_us, self._conditions)
        axis = int(self._set["ROUT:AXIS"])
        return bench.sine(self._set["SOUR1:FREQ"], self._level(), axis, seconds, self._start_us, self._conditions)


simulated = Generator
