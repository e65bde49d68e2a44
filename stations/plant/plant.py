"""The plant: table, chamber, fixture and devices under one clock, moved by register writes and by nothing else."""

from __future__ import annotations

import heapq
import math
import threading
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schemas.errors import WrongUse
from schemas.station import MOST_SLOTS, Simulation, StationConfig
from stations.plant.banks import build_banks, build_speakers
from stations.plant.device import Devices, Truth, draw_truth, rotation, stream
from stations.plant.dynamics import Dynamics
from stations.plant.faults.catalogue import trouble_of
from stations.plant.fixture import Fixture
from stations.plant.hidden import hidden_effect
from stations.plant.journal import Injection, Journal, Said, Write, fingerprint
from stations.plant.keyed import keyed_normal
from stations.plant.moisture import Moisture
from stations.plant.noise import Noise
from stations.plant.physics import Physics
from stations.plant.preset import Preset, load_preset
from stations.plant.sampler import Sampler
from stations.plant.table import Axis
from stations.profile_files import load_profile

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from schemas.fault import FaultOrder
    from schemas.profile import Space
    from schemas.recipe import Lot
    from stations.plant.faults.base import Fault
    from stations.plant.hidden import HiddenEffect

Array = NDArray[np.float64]

AIR, THERMOMETER, SUPPLY, VIBRATION, HUMIDITY, OUTER, INNER = 1, 2, 3, 4, 5, 10, 20  # channels of keyed noise
STANDARD_G = 9.80665  # m/s², CGPM 1901
AIR_NOISE_K = 0.01
SUPPLY_NOISE = 2e-5
VIBRATION_NOISE = 0.02
HUMIDITY_NOISE_PCT = 0.1


class Plant:
    """A simulated station and a lot in it. ``lock`` is held by whoever reads, writes or moves the time."""

    def __init__(self, config: StationConfig, lot: Lot, hidden: Sequence[HiddenEffect] = ()) -> None:
        sim = config.simulation or Simulation()
        _refuse_slots(lot, config.devices.slots.count)
        self.lock = threading.RLock()
        self.now_us = 0
        self.emergency_stop = False
        self.powered = True
        self._switched_us = 0  # when the devices' supply was last switched
        self.heard: set[int] = set()  # ids that were asked something since somebody last cleared this
        self.preset: Preset = load_preset(lot.device, sim.preset_overrides)
        self.serials = [unit.serial for unit in lot.units]
        self.slots = [unit.slot for unit in lot.units]
        self.seats = list(range(len(lot.units)))  # which unit sits where another one should
        self._key = int(stream(sim.seed, lot.seed, lot.repeat).integers(2**62))
        self.outer, self.inner = Axis(self._key, OUTER), Axis(self._key, INNER)
        effects = [*hidden, *(hidden_effect(h.kind, h.figures) for h in sim.hidden)]
        for number, effect in enumerate(effects):
            effect.begin(len(self.slots), stream(lot.seed, "hidden", number))
        air, water = (stream(sim.seed, lot.seed, lot.repeat, name) for name in ("air", "moisture"))
        self.fixture = Fixture(sim, self.slots, air, effects, Moisture(water))
        self._supply = 1.0 + sim.supply_spread * stream(sim.seed, "supply").standard_normal(64)[self.slots]
        self._sag = np.ones(len(self.slots))
        self._truths = self._draw_truths(sim, lot)
        noise = [stream(sim.seed, lot.seed, lot.repeat, serial, "noise") for serial in self.serials]
        turn_on = [stream(sim.seed, lot.seed, lot.repeat, serial, "turn-on") for serial in self.serials]
        self.physics = Physics(
            (self.outer, self.inner),
            self.fixture,
            np.stack([t.slot_rotation for t in self._truths]),
            Devices(self.preset, self._truths, turn_on),
            Dynamics(self.preset),
            Noise(self.preset, noise),
            effects,
            sim.local_gravity_m_s2 / STANDARD_G,
        )
        fifo = load_profile(config.devices.slots.profile).fifo
        registers = fifo.registers if fifo is not None else 0
        self.sampler = Sampler(self.physics, len(self.slots), self.preset.packing, registers)
        self._devices = config.devices
        self.troubles: list[Fault] = []
        self._due: list[tuple[int, int, Callable[[Plant], None]]] = []  # what begins or ends, and when, in µs
        self.clock_off_s = 0.0
        self.frozen: dict[int, float] = {}
        self.frozen_air: float | None = None
        self.banks = build_banks(self, config.devices)
        self.speakers = build_speakers(self, config.devices)
        self.journal = Journal(fingerprint(config, lot))
        self.fixture.step_to(1.0, self.physics.force_at)
        for fault in sim.faults:
            self._arrange(fault)

    def _draw_truths(self, sim: Simulation, lot: Lot) -> list[Truth]:
        seats = 1e-3 * sim.slot_rotation_mrad * stream(sim.seed, "slots").standard_normal((64, 3))
        return [
            draw_truth(
                self.preset,
                unit.serial,
                lot.seed,
                slot_rotation=rotation(seats[unit.slot]),
                supply_ratio=float(self._supply[i]),
                output_scale=self.preset.scale,
            )
            for i, unit in enumerate(lot.units)
        ]

    @property
    def now(self) -> float:
        """The plant's time, s since power-on."""
        return self.now_us * 1e-6

    def advance(self, microseconds: int) -> None:
        """Lets time pass; one call or many make no difference."""
        with self.lock:
            target = self.now_us + microseconds
            while self._due and self._due[0][0] <= target:
                at, _, act = heapq.heappop(self._due)
                self._pass_until(max(self.now_us, at))
                act(self)
            self._pass_until(target)

    def _pass_until(self, target_us: int) -> None:
        self.fixture.step_to(target_us * 1e-6, self.physics.force_at)
        self.now_us = target_us
        self.sampler.advance(target_us)

    def read(self, device_id: int, address: int, count: int, space: Space = "holding") -> list[tuple[int, list[int]]]:
        """Words, or bits, of every register that a span touches, each with its address, as the device tells them now."""
        found = self.banks[device_id].read(address, count, space)
        for trouble in self._now(device_id):
            found = [(first, trouble.on_read(self.now_us, first, words)) for first, words in found]
        return found

    def write(self, device_id: int, address: int, words: list[int], space: Space = "holding") -> int:
        """A register write, at the plant's time; the exception code of the answer. What a device refuses leaves no trace."""
        with self.lock:
            bank, code = self.banks[device_id], 0
            for trouble in self._now(device_id):
                held = [word for _, part in bank.read(address, len(words), space) for word in part]
                whole = held if len(held) == len(words) else None
                code = trouble.on_write(words, whole, partial(bank.write, address, space=space))
                break
            else:
                bank.write(address, words, space)
            self.journal.add(Write(self.now_us, device_id, address, tuple(words), space))
            return code

    def say(self, device_id: int, line: str) -> str | None:
        """What a device that is spoken to in lines answers, at the plant's time; None where nothing comes back."""
        with self.lock:
            if self.answer_of(device_id):
                return None
            answer, acted = self.speakers[device_id].answer(line)
            if acted:
                self.journal.add(Said(self.now_us, device_id, line))
            return answer

    def inject(self, fault: FaultOrder) -> None:
        """Arranges a fault."""
        with self.lock:
            self._arrange(fault)
            self.journal.add(Injection(self.now_us, fault))

    def _arrange(self, fault: FaultOrder) -> None:
        trouble = trouble_of(fault, self.serials)
        trouble.device_id = self._id_of(fault)
        trouble.unit = self.serials.index(fault.serial) if fault.serial else 0
        self.troubles.append(trouble)
        order = 2 * len(self.troubles)
        heapq.heappush(self._due, (round(fault.at_s * 1e6), order, trouble.begins))
        if fault.for_s is not None:
            heapq.heappush(self._due, (round(fault.until_s * 1e6), order + 1, trouble.ends))
        self.advance(0)

    def _now(self, device_id: int) -> list[Fault]:
        """Troubles that a device has now."""
        now = self.now
        return [t for t in self.troubles if t.device_id == device_id and t.fault.at_s <= now < t.fault.until_s]

    def answer_of(self, device_id: int) -> int:
        """The exception code with which the device behind an id answers everything now; 0 where it answers as always."""
        return next((code for trouble in self._now(device_id) if (code := trouble.answers())), 0)

    def _id_of(self, fault: FaultOrder) -> int:
        """The device id that a fault is about; 0 where it is about none."""
        if fault.device:
            return int(getattr(self._devices, fault.device).device_id)
        if fault.serial:
            return self._devices.slots.device_id + self.slots[self.serials.index(fault.serial)]
        return 0

    def switch(self, *, on: bool) -> None:
        """The supply of all devices, by the station's relay; the state that it is in already changes nothing."""
        if on == self.powered:
            return
        self.powered, self._switched_us = on, self.now_us
        self.physics.power(on=on, now=self.now)

    @property
    def since_power(self) -> float:
        """Seconds since the devices were powered; 0 while they are off."""
        return (self.now_us - self._switched_us) * 1e-6 if self.powered else 0.0

    def sag(self, units: Sequence[int], factor: float) -> None:
        """Supplies of some units at a part of what they were."""
        self._sag[list(units)] = factor
        self.physics.devices.supply(self._sag)

    def truth(self, serial: str) -> Truth:
        """What a unit really is; for tests and benchmarks, never for a client."""
        return self._truths[self.serials.index(serial)]

    def air_reading(self) -> float:
        """The chamber's own thermometer, °C."""
        if self.frozen_air is not None:
            return self.frozen_air
        noise = AIR_NOISE_K * float(self._noise(AIR, 1)[0])
        return float(self.fixture.air.at(np.array([self.now]))[0]) + noise

    def temperature_reading(self) -> list[float]:
        """The thermometers of the slots, °C; empty slots say the air's."""
        element = self.fixture.temperature.at(np.array([self.now]))[0]
        raw = element + self.preset.thermometer_noise_K * self._noise(THERMOMETER, len(element))
        step = self.preset.thermometer_resolution_K
        told = self._by_slot(np.round(raw / step) * step, float(self.fixture.air.at(np.array([self.now]))[0]))
        if not self.powered:
            told = [math.nan if slot in self.slots else value for slot, value in enumerate(told)]
        return [self.frozen.get(slot, value) for slot, value in enumerate(told)]

    def supply_reading(self) -> list[float]:
        """Supply of the slots, V; nothing at empty ones."""
        noise = SUPPLY_NOISE * self._noise(SUPPLY, len(self.slots))
        told = self.preset.supply_V * self._sag * (self._supply + noise)
        return self._by_slot(told if self.powered else 0.0 * told, 0.0)

    def vibration_reading(self) -> float:
        """The fixture's vibration, g rms."""
        noise = 1.0 + VIBRATION_NOISE * float(self._noise(VIBRATION, 1)[0])
        return float(self.fixture.vibration.at(np.array([self.now]))[0]) * noise

    def humidity_reading(self) -> float:
        """Relative humidity beside the fixture, %."""
        true = float(self.fixture.humidity(np.array([self.now]))[0])
        return min(100.0, max(0.0, true + HUMIDITY_NOISE_PCT * float(self._noise(HUMIDITY, 1)[0])))

    def _noise(self, channel: int, n: int) -> Array:
        return keyed_normal(self._key, channel, int(self.now), n)

    def _by_slot(self, values: Array, empty: float) -> list[float]:
        out = [empty] * MOST_SLOTS
        for slot, value in zip(self.slots, values, strict=True):
            out[slot] = float(value)
        return out


def _refuse_slots(lot: Lot, count: int) -> None:
    for unit in lot.units:
        if unit.slot >= count:
            raise WrongUse(
                f"lot: unit {unit.serial} sits in slot {unit.slot}, the fixture has 0 to {count - 1}; move it"
            )
