"""The plant: table, chamber, fixture and devices under one clock, moved by register writes and by nothing else."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schemas.errors import WrongUse, did_you_mean
from schemas.station import SLOTS, Fault, Simulation, StationConfig
from stations.plant.banks import build_banks
from stations.plant.device import Devices, Truth, draw_truth, rotation, stream
from stations.plant.dynamics import Dynamics
from stations.plant.fixture import Fixture
from stations.plant.hidden import hidden_effect
from stations.plant.journal import Injection, Journal, Write, fingerprint
from stations.plant.keyed import keyed_normal
from stations.plant.noise import Noise
from stations.plant.physics import Physics
from stations.plant.preset import Preset, load_preset
from stations.plant.sampler import Sampler
from stations.plant.table import Axis
from stations.profile_files import load_profile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from schemas.recipe import Lot
    from stations.plant.hidden import HiddenEffect

Array = NDArray[np.float64]

AIR, THERMOMETER, SUPPLY, VIBRATION, OUTER, INNER = 1, 2, 3, 4, 10, 20  # channels of keyed noise
STANDARD_G = 9.80665  # m/s², CGPM 1901
AIR_NOISE_K = 0.01
SUPPLY_NOISE = 2e-5
VIBRATION_NOISE = 0.02


class Plant:
    """A simulated station and a lot in it. ``lock`` is held by whoever reads, writes or moves the time."""

    def __init__(self, config: StationConfig, lot: Lot, hidden: Sequence[HiddenEffect] = ()) -> None:
        sim = config.simulation or Simulation()
        _refuse_slots(lot)
        self.lock = threading.RLock()
        self.now_us = 0
        self.preset: Preset = load_preset(lot.device, sim.preset_overrides)
        self.serials = [unit.serial for unit in lot.units]
        self.slots = [unit.slot for unit in lot.units]
        self._key = int(stream(sim.seed, lot.seed, lot.repeat).integers(2**62))
        self.outer, self.inner = Axis(self._key, OUTER), Axis(self._key, INNER)
        effects = [*hidden, *(hidden_effect(h.kind, h.figures) for h in sim.hidden)]
        for number, effect in enumerate(effects):
            effect.begin(len(self.slots), stream(lot.seed, "hidden", number))
        self.fixture = Fixture(sim, self.slots, stream(sim.seed, lot.seed, lot.repeat, "air"), effects)
        self._supply = 1.0 + sim.supply_spread * stream(sim.seed, "supply").standard_normal(64)[self.slots]
        self._truths = self._draw_truths(sim, lot)
        noise = [stream(sim.seed, lot.seed, lot.repeat, serial, "noise") for serial in self.serials]
        self._physics = Physics(
            (self.outer, self.inner),
            self.fixture,
            np.stack([t.slot_rotation for t in self._truths]),
            Devices(self.preset, self._truths),
            Dynamics(self.preset),
            Noise(self.preset, noise),
            effects,
            sim.local_gravity_m_s2 / STANDARD_G,
        )
        fifo = load_profile(config.devices.slots.profile).fifo
        registers = fifo.registers if fifo is not None else 0
        self.sampler = Sampler(self._physics, len(self.slots), self.preset.packing, registers)
        self._devices = config.devices
        self.faults: list[Fault] = []
        self.banks = build_banks(self, config.devices)
        self.journal = Journal(fingerprint(config, lot))
        self.fixture.step_to(1.0, self._physics.force_at)
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
            for fault in self.faults:
                if fault.kind == "door" and self.now_us <= fault.at_s * 1e6 <= target:
                    self._pass_until(max(self.now_us, round(fault.at_s * 1e6)))
                    self.fixture.chamber.door_open = True
            self._pass_until(target)

    def _pass_until(self, target_us: int) -> None:
        self.fixture.step_to(target_us * 1e-6, self._physics.force_at)
        self.now_us = target_us
        self.sampler.advance(target_us)

    def write(self, device_id: int, address: int, words: list[int]) -> None:
        """A register write, at the plant's time; what a device refuses leaves no trace."""
        with self.lock:
            self.banks[device_id].write(address, words)
            self.journal.add(Write(self.now_us, device_id, address, tuple(words)))

    def inject(self, fault: Fault) -> None:
        """Arranges a fault."""
        with self.lock:
            self._arrange(fault)
            self.journal.add(Injection(self.now_us, fault))

    def _arrange(self, fault: Fault) -> None:
        if fault.serial and fault.serial not in self.serials:
            message = f"fault {fault.kind}: no unit '{fault.serial}'; {did_you_mean(fault.serial, self.serials)}"
            raise WrongUse(message)
        self.faults.append(fault)
        if fault.kind == "dead":
            self._physics.dead_from[self.serials.index(fault.serial)] = fault.at_s

    def fault_of(self, device_id: int) -> str:
        """``silent``, ``mute`` or nothing: how the device behind an id answers now."""
        for fault in self.faults:
            if fault.kind in {"silent", "mute"} and fault.at_s <= self.now and device_id == self._id_of(fault):
                return fault.kind
        return ""

    def _id_of(self, fault: Fault) -> int:
        """The device id that a fault is about."""
        if fault.device:
            return int(getattr(self._devices, fault.device).device_id)
        return self._devices.slots.device_id + self.slots[self.serials.index(fault.serial)]

    def truth(self, serial: str) -> Truth:
        """What a unit really is; for tests and benchmarks, never for a client."""
        return self._truths[self.serials.index(serial)]

    def air_reading(self) -> float:
        """The chamber's own thermometer, °C."""
        noise = AIR_NOISE_K * float(self._noise(AIR, 1)[0])
        return float(self.fixture.air.at(np.array([self.now]))[0]) + noise

    def temperature_reading(self) -> list[float]:
        """The thermometers of the slots, °C; empty slots say the air's."""
        element = self.fixture.temperature.at(np.array([self.now]))[0]
        raw = element + self.preset.thermometer_noise_K * self._noise(THERMOMETER, SLOTS)[: len(element)]
        step = self.preset.thermometer_resolution_K
        return self._by_slot(np.round(raw / step) * step, float(self.fixture.air.at(np.array([self.now]))[0]))

    def supply_reading(self) -> list[float]:
        """Supply of the slots, V; nothing at empty ones."""
        noise = SUPPLY_NOISE * self._noise(SUPPLY, SLOTS)[: len(self.slots)]
        return self._by_slot(self.preset.supply_V * (self._supply + noise), 0.0)

    def vibration_reading(self) -> float:
        """The fixture's vibration, g rms."""
        noise = 1.0 + VIBRATION_NOISE * float(self._noise(VIBRATION, 1)[0])
        return float(self.fixture.vibration.at(np.array([self.now]))[0]) * noise

    def _noise(self, channel: int, n: int) -> Array:
        return keyed_normal(self._key, channel, int(self.now), n)

    def _by_slot(self, values: Array, empty: float) -> list[float]:
        out = [empty] * SLOTS
        for slot, value in zip(self.slots, values, strict=True):
            out[slot] = float(value)
        return out


def _refuse_slots(lot: Lot) -> None:
    for unit in lot.units:
        if unit.slot >= SLOTS:
            message = f"lot: unit {unit.serial} sits in slot {unit.slot}, the fixture has 0 to {SLOTS - 1}; move it"
            raise WrongUse(message)
