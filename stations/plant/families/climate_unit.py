"""The simulated climate unit at the chamber of the table, with the recorder of the units and of its own sensors."""

import math

import numpy as np

from schemas.profile import Profile
from stations.plant.bench import Waveforms
from stations.plant.climate import AMBIENT_HPA, Leg
from stations.plant.equipment import UNKNOWN, ResultFiles, taken
from stations.plant.world import World

RECORD_S = 10.0
SENSOR_NOISE = np.array([0.02, 0.2, 0.2])  # K, %, hPa
CHANNEL = 8  # of keyed noise


class Unit:
    """Carries out one leg after the other; what it has reached stays until it is told to vent."""

    def __init__(self, world: World, profile: Profile) -> None:
        self._world = world
        self._set = {"TEMP": 25.0, "HUM": 0.0, "PRES": AMBIENT_HPA, "CHANGE": 60.0, "HOLD": 0.0}
        self._start_us, self._until_us, self._number, self._trouble = 0, 0, 0, ""
        self._recorded: dict[int, Waveforms] = {}
        self._files = ResultFiles()

    def answer(self, line: str) -> tuple[str, bool]:  # noqa: PLR0911 - one return an order
        head, _, value = line.partition(" ")
        running = self._world.now_us < self._until_us
        if line == "STAT?":
            return (f"ABORT,{self._trouble}" if self._trouble else "RUN,-" if running else "DONE,-"), False
        if line == "FILE?":
            if running or self._number not in self._recorded:
                return "NONE", False
            recorded = self._recorded[self._number]
            return self._files.write(self._number, lambda: recorded, self._world.slots, "air"), False
        if head in self._set:
            return ("NA:BUSY", False) if running else taken(self._set, head, value)
        if line == "RUN GO":
            return ("NA:BUSY", False) if running else self._run()
        if line == "VENT NOW":
            self._until_us = min(self._until_us, self._world.now_us)
            self._world.fixture.climate.vent()
            return "OK", True
        if line.endswith("?") and line[:-1] in self._set:
            return f"{self._set[line[:-1]]:.7g}", False
        return UNKNOWN, False

    def _run(self) -> tuple[str, bool]:
        world, orders = self._world, self._set
        self._trouble = "door of the climate unit open" if "controller_abort" in world.bench.conditions else ""
        if self._trouble:
            return "OK", True
        if "missed_trigger" in world.bench.conditions:
            return "OK", True
        humidity = orders["HUM"] or math.nan
        leg = Leg(orders["TEMP"], humidity, orders["PRES"], max(1.0, orders["CHANGE"]), orders["HOLD"])
        world.fixture.climate.begin(leg, world.fixture.chamber.air, world.fixture.humidity_now())
        self._number += 1
        self._start_us = world.now_us
        self._until_us = world.now_us + round(1e6 * (leg.change_s + leg.hold_s))
        number, until = self._number, self._until_us
        # at its end, not when its file is asked for: the noise of the units goes on in the order of the plant's time
        world.schedule(1e-6 * until, -1000 - number, lambda _: self._record(number, until))
        return "OK", True

    def _record(self, number: int, until_us: int) -> None:
        if (number, until_us) != (self._number, self._until_us):
            return  # vented before its end
        world, start = self._world, 1e-6 * self._start_us
        count = max(1, int((1e-6 * until_us - start) / RECORD_S))
        time = start + RECORD_S * np.arange(1, count + 1, dtype=np.float64)
        world.physics.begin(start, 1.0 / RECORD_S)
        outputs = world.preset.lsb * world.physics.samples(time, 1.0 / RECORD_S).astype(np.float64)
        fixture = world.fixture
        air = np.column_stack([fixture.air.at(time), fixture.humidity(time), fixture.pressure.at(time)])
        noise = world.bench.stream_at(self._start_us, CHANNEL).standard_normal(air.shape)
        self._recorded = {number: Waveforms(outputs, 1.0 / RECORD_S, air + SENSOR_NOISE * noise, 1.0 / RECORD_S)}


simulated = Unit
