"""The simulated world of a station: time, axes, chamber, fixture, devices under test, and what its sensors read.

It knows no register, no fault and no journal: those act on it from outside.
"""

import heapq
import math
import threading
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from schemas.errors import WrongUse
from schemas.lot import Lot
from schemas.simulation import Simulation
from schemas.station import StationConfig
from schemas.station_devices import MOST_SLOTS
from schemas.units import STANDARD_GRAVITY_M_S2
from stations.plant.bench import Bench
from stations.plant.device import PlantDevices, Truth, draw_truth, keyed_normal, rotation, stream
from stations.plant.dynamics import Dynamics
from stations.plant.eeprom import Eeprom
from stations.plant.fixture import Fixture, Moisture
from stations.plant.flash import Flash
from stations.plant.hidden import HiddenEffect, hidden_effect
from stations.plant.hidden.table import StationErrors
from stations.plant.noise import UnitNoise
from stations.plant.physics import Physics, Sampler
from stations.plant.preset import Preset, load_preset
from stations.plant.table import Axis
from stations.plant.turning import TurningForce
from stations.profile_files import load_profile

Array = NDArray[np.float64]

AIR, THERMOMETER, SUPPLY, VIBRATION, HUMIDITY, OUTER, INNER = 1, 2, 3, 4, 5, 10, 20  # channels of keyed noise
AIR_NOISE_K = 0.01
VIBRATION_NOISE = 0.02
HUMIDITY_NOISE_PCT = 0.1
OUTAGE_S = 1.0


READING_NOISE = 2e-5  # relative, of one reading of the meter
SLOWEST_S, FASTEST_S = 6.0 * 3600.0, 900.0  # periods of the drift: a regulator follows the temperature of the room
WAVES = 8


class World:
    """The physics of a simulated station with a lot in it. Hold ``lock`` to read, to write or to advance the time."""

    def __init__(self, config: StationConfig, lot: Lot, hidden: Sequence[HiddenEffect] = ()) -> None:
        sim = config.simulation or Simulation()
        count = config.devices.slots.count
        for unit in lot.units:
            if unit.slot >= count:
                raise WrongUse(
                    f"lot: unit {unit.serial} sits in slot {unit.slot}, the fixture has 0 to {count - 1}; move it"
                )
        self.lock = threading.RLock()
        self.now_us = 0
        self.emergency_stop = False
        self.powered = True
        self._switched_us = 0  # when the devices' supply was last switched
        self.preset: Preset = load_preset(lot.device, sim.preset_overrides).with_axes(lot.sensor_axes)
        self.serials = [unit.serial for unit in lot.units]
        self.slots = [unit.slot for unit in lot.units]
        self.seats = list(range(len(lot.units)))  # index of the unit that really sits in each unit's slot
        self._key = int(stream(sim.seed, lot.seed, lot.repeat).integers(2**62))
        self.outer, self.inner = Axis(self._key, OUTER), Axis(self._key, INNER)
        effects = [*hidden, *(hidden_effect(h.kind, h.figures) for h in sim.hidden)]
        for number, effect in enumerate(effects):
            effect.begin(len(self.slots), stream(lot.seed, "hidden", number))
        errors = sim.reference_errors
        self.station_errors = None if errors is None else StationErrors(errors, stream(sim.seed, "references"))
        if self.station_errors is not None:
            effects.append(self.station_errors)
            self.outer.scatter_deg = self.inner.scatter_deg = self.station_errors.pose_deg
        air, water = (stream(sim.seed, lot.seed, lot.repeat, name) for name in ("air", "moisture"))
        self.fixture = Fixture(sim, self.slots, air, effects, Moisture(water))
        drift = stream(sim.seed, lot.seed, lot.repeat, "supply drift")
        self._supplies = Supplies(sim, self.slots, drift, followed=self.preset.ratiometric > 0.0)
        self._truths = self._draw_truths(sim, lot)
        noise = [stream(sim.seed, lot.seed, lot.repeat, serial, "noise") for serial in self.serials]
        turn_on = [stream(sim.seed, lot.seed, lot.repeat, serial, "turn-on") for serial in self.serials]
        gravity = sim.local_gravity_m_s2 / STANDARD_GRAVITY_M_S2
        self.physics = Physics(
            TurningForce(self.outer, self.inner, sim.turning, self.slots),
            self.fixture,
            np.stack([t.slot_rotation for t in self._truths]),
            PlantDevices(self.preset, self._truths, turn_on, self._supplies.drift),
            Dynamics(self.preset),
            UnitNoise(self.preset, noise),
            effects,
            gravity,
        )
        self.physics.orthogonality = 0.0 if self.station_errors is None else self.station_errors.orthogonality
        self.flash = [Flash() for _ in self.serials]  # by unit, in any slot
        self.teds = [Eeprom() for _ in self.serials]
        self.bench = Bench(
            self.preset,
            self._truths,
            self.physics.devices,
            gravity,
            sim.seed,
            lot.seed,
            self._key,
            effects,
            self._around,
        )
        fifo = load_profile(config.devices.slots.profile).fifo
        registers = fifo.registers if fifo is not None else 0
        self.sampler = Sampler(self.physics, len(self.slots), self.preset.packing, registers)
        self._due: list[tuple[int, int, Callable[[World], None]]] = []  # time in µs, order among equals, action
        self.clock_offset_s = 0.0
        self.frozen_slots_C: dict[int, float] = {}
        self.frozen_air_C: float | None = None
        self.fixture.step_to(1.0, self.physics.force_at)

    def _draw_truths(self, sim: Simulation, lot: Lot) -> list[Truth]:
        seats = 1e-3 * sim.slot_rotation_mrad * stream(sim.seed, "slots").standard_normal((64, 3))
        truth_of = partial(draw_truth, self.preset, seed=lot.seed, output_scale=self.preset.scale)
        units = zip(lot.units, self._supplies.offset.tolist(), strict=True)
        return [
            truth_of(unit.serial, slot_rotation=rotation(seats[unit.slot]), supply_ratio=ratio) for unit, ratio in units
        ]

    @property
    def now(self) -> float:
        """Time since power-on, s."""
        return self.now_us * 1e-6

    def _around(self) -> tuple[Array, float]:
        """Temperature of the units, °C, and pressure of the air, hPa, now."""
        now = np.array([self.now])
        return self.fixture.temperature.at(now)[0], float(self.fixture.pressure.at(now)[0])

    def advance(self, microseconds: int) -> None:
        """Advances the time; the result does not depend on the number of calls."""
        with self.lock:
            target = self.now_us + microseconds
            while self._due and self._due[0][0] <= target:
                at, _, action = heapq.heappop(self._due)
                self._pass_until(max(self.now_us, at))
                action(self)
            self._pass_until(target)

    def _pass_until(self, target_us: int) -> None:
        self.fixture.step_to(target_us * 1e-6, self.physics.force_at)
        self.now_us = target_us
        self.sampler.advance(target_us)

    def schedule(self, at_s: float, order: int, action: "Callable[[World], None]") -> None:
        """Calls ``action`` with this world at ``at_s`` s; among equal times the smaller ``order`` comes first."""
        heapq.heappush(self._due, (round(at_s * 1e6), order, action))

    def switch(self, *, on: bool) -> None:
        """Switches the supply of all devices by the station's relay; a switch to the present state changes nothing."""
        if on == self.powered:
            return
        self.powered, self._switched_us = on, self.now_us
        if not on:
            for unit, flash in enumerate(self.flash):
                flash.power_off(self.now_us)
                self.teds[unit].power_off()
                self.physics.devices.set_offsets(unit, flash.offsets)
        self.physics.power(on=on, now=self.now)

    @property
    def since_power(self) -> float:
        """Seconds since the devices were powered; 0 while they are off."""
        return (self.now_us - self._switched_us) * 1e-6 if self.powered else 0.0

    def program_memory(self, unit: int, copy: int) -> None:
        """Programs the buffer of a unit into one of its copies; the supply may fail during it, if a fault is set."""
        flash = self.flash[unit]
        flash.program(copy, self.now_us)
        if flash.lose_power_s is not None:
            at, flash.lose_power_s = self.now + flash.lose_power_s, None
            self.schedule(at, -2 * unit - 2, lambda world: world.switch(on=False))
            self.schedule(at + OUTAGE_S, -2 * unit - 1, lambda world: world.switch(on=True))

    def set_offsets(self, unit: int, steps: Sequence[int]) -> None:
        """Sets the offset registers of a unit."""
        self.flash[unit].offsets = list(steps)
        self.physics.devices.set_offsets(unit, steps)

    def scale_supply(self, units: Sequence[int], factor: float) -> None:
        """Sets the supplies of some units to ``factor`` times their nominal voltage."""
        self._supplies.factor[list(units)] = factor
        self.physics.devices.supply(self._supplies.factor)

    def set_ripple(self, volt: float, hertz: float) -> None:
        """Puts a sine of ``volt`` V (peak) at ``hertz`` Hz on the supplies of all units."""
        self.physics.devices.ripple = (volt / self.preset.supply_V, hertz)

    def truth(self, serial: str) -> Truth:
        """The true parameters of a unit; for tests and benchmarks, never for a client."""
        return self._truths[self.serials.index(serial)]

    def air_reading(self) -> float:
        """Reading of the chamber's thermometer, °C."""
        if self.frozen_air_C is not None:
            return self.frozen_air_C
        noise = AIR_NOISE_K * float(self._noise(AIR, 1)[0])
        return float(self.fixture.air.at(np.array([self.now]))[0]) + noise

    def temperature_reading(self) -> list[float]:
        """Readings of the slots' thermometers, °C; those of empty slots read the air."""
        element = self.fixture.temperature.at(np.array([self.now]))[0]
        if self.station_errors is not None:
            element = self.station_errors.reading(element)
        raw = element + self.preset.thermometer_noise_K * self._noise(THERMOMETER, len(element))
        step = self.preset.thermometer_resolution_K
        readings = self._by_slot(np.round(raw / step) * step, float(self.fixture.air.at(np.array([self.now]))[0]))
        if not self.powered:
            readings = [math.nan if slot in self.slots else value for slot, value in enumerate(readings)]
        return [self.frozen_slots_C.get(slot, value) for slot, value in enumerate(readings)]

    def supply_reading(self) -> list[float]:
        """Supply of the slots, V; 0 at empty slots."""
        volt = self.preset.supply_V * self._supplies.reading(self.now, self._noise(SUPPLY, len(self.slots)))
        return self._by_slot(volt if self.powered else 0.0 * volt, 0.0)

    def vibration_reading(self) -> float:
        """Vibration of the fixture, g rms."""
        noise = 1.0 + VIBRATION_NOISE * float(self._noise(VIBRATION, 1)[0])
        return float(self.fixture.vibration.at(np.array([self.now]))[0]) * noise

    def humidity_reading(self) -> float:
        """Relative humidity beside the fixture, %."""
        true = float(self.fixture.humidity(np.array([self.now]))[0])
        return min(100.0, max(0.0, true + HUMIDITY_NOISE_PCT * float(self._noise(HUMIDITY, 1)[0])))

    def _noise(self, channel: int, n: int) -> Array:
        return keyed_normal(self._key, channel, int(self.now), n)

    def _by_slot(self, values: Array, empty: float) -> list[float]:
        filled = dict(zip(self.slots, values.tolist(), strict=True))
        return [filled.get(slot, empty) for slot in range(MOST_SLOTS)]


class Supplies:
    """A regulator for each slot: an offset that stays, a drift that is another in each run, and a set ratio of all.

    The drift is a sum of waves, so that its value at any instant does not depend on the steps in which the time passes. Outputs
    that do not follow their supply reject changes of this size: theirs has no drift.
    """

    def __init__(self, sim: Simulation, slots: Sequence[int], run: np.random.Generator, *, followed: bool) -> None:
        numbers = list(slots)
        self.offset = 1.0 + sim.supply_spread * stream(sim.seed, "supply").standard_normal(64)[numbers]
        self.factor = np.ones(len(numbers))
        self._meter = 1.0 + 1e-6 * sim.supply_reading_ppm * float(stream(sim.seed, "supply meter").standard_normal())
        self._amplitude = sim.supply_drift * math.sqrt(2.0 / WAVES) if followed else 0.0
        self._phase = run.uniform(0.0, 2.0 * math.pi, (64, WAVES))[numbers]
        self._rate = 2.0 * math.pi / np.geomspace(SLOWEST_S, FASTEST_S, WAVES)

    def drift(self, time: Array) -> Array | float:
        """Relative departure from the offset at instants (n,), s, of every slot, (n, slots)."""
        if self._amplitude == 0.0:
            return 0.0
        return self._amplitude * np.sin(np.asarray(time)[:, None, None] * self._rate + self._phase).sum(axis=-1)

    def reading(self, now: float, normal: Array) -> Array:
        """Readings of the meter over the nominal voltage at ``now`` s, (slots,), from standard normal numbers."""
        true = self.offset * (1.0 + np.reshape(self.drift(np.array([now])), (-1,)))
        return self._meter * self.factor * (true + READING_NOISE * normal)
