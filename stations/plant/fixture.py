"""The thermal chamber, stepped once a second, and the fixture in it.

Chamber: controller, air, walls, compressor and door. Fixture: temperatures of air and elements, vibration, and humidity.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.simulation import Simulation
from stations.plant.climate import AMBIENT_HPA, DAMPER_S, Climate
from stations.plant.device import stream
from stations.plant.hidden import HiddenEffect

STEP_S = 1.0
POWER_K_S = 0.15  # heating or cooling of the air at full power
ACTUATOR_S = 10.0
WALL_S = 600.0  # air to wall
WALL_MASS = 3.0  # heat capacity of the wall over that of the air
LEAK_S = 3000.0
DOOR_S = 60.0
GAIN_PER_K = 0.5
INTEGRAL_S = 120.0
QUIET_G = 5e-6  # vibration of the building, rms
COMPRESSOR_G = 60e-6
COOLING_FLOOR = 0.15  # fraction of the compressor capacity that runs whenever the set point is below room temperature


@dataclass
class Chamber:
    """Air at ``air`` °C, walls at ``wall`` °C; the controller ramps its working set point."""

    room: float
    ramp_K_min: float
    set_point: float = 25.0
    working: float = 25.0
    air: float = 25.0
    wall: float = 25.0
    power: float = 0.0
    integral: float = 0.0
    running: bool = True
    door_open: bool = False
    powered: bool = True
    winds_up: bool = False
    hunting: tuple[float, float] = (0.0, 1.0)  # K, s
    shaken_g: float = 0.0
    seconds: float = 0.0

    def step(self, store: float = math.nan) -> None:
        """Advances by one second; the dampers of a climate unit let in air of ``store`` °C where that is a number."""
        if not math.isnan(store):
            self._follow(store)
            return
        reach = self.ramp_K_min / 60.0 * STEP_S
        self.working += float(np.clip(self.set_point - self.working, -reach, reach))
        self.seconds += STEP_S
        swing, period = self.hunting
        error = self.working + swing * math.sin(2.0 * math.pi * self.seconds / period) - self.air
        unlimited = GAIN_PER_K * error + self.integral
        demand = float(np.clip(unlimited, -1.0, 1.0)) if self.running and self.powered else 0.0
        if unlimited == demand or self.winds_up:  # no integration while the actuator is saturated
            self.integral += GAIN_PER_K * error * STEP_S / INTEGRAL_S
        self.power += (demand - self.power) * STEP_S / ACTUATOR_S
        leak = DOOR_S if self.door_open else LEAK_S
        to_wall = (self.wall - self.air) / WALL_S
        self.air += STEP_S * (POWER_K_S * self.power + to_wall + (self.room - self.air) / leak)
        self.wall -= STEP_S * to_wall / WALL_MASS

    def _follow(self, store: float) -> None:
        """The air follows that of the store; the controller tracks it, and takes over without a jump."""
        self.air += STEP_S * (store - self.air) / DAMPER_S
        self.wall -= STEP_S * (self.wall - self.air) / (WALL_S * WALL_MASS)
        self.working, self.power, self.integral = self.air, 0.0, 0.0
        self.seconds += STEP_S

    def vibration(self) -> float:
        """Vibration of the fixture, g rms, from the building and, in proportion to its cooling power, the compressor."""
        quiet = math.hypot(QUIET_G, self.shaken_g)
        if not self.running or not self.powered:
            return quiet
        duty = max(0.0, -self.power)
        if self.working < self.room:
            duty = max(duty, COOLING_FLOOR)
        return float(np.hypot(quiet, COMPRESSOR_G * np.sqrt(duty)))


Array = NDArray[np.float64]

AIR_UNREST_K = 0.01
AIR_UNREST_S = 30.0
ROOM_HPA = 12.5  # vapour pressure of a room at 23 °C and 45 %
UNREST = 0.12  # relative amplitude of each variation
PERIODS_S = (1500.0, 4100.0, 11000.0)  # air conditioning, doors, weather


class Fixture:
    """Slots, each with its thermal lag and its position in the air stream. Steps are computed one ahead of the clock.

    A command in the middle of a second acts from the next whole second on, so that the result does not depend on the division of
    the time before it into steps.
    """

    def __init__(
        self,
        sim: Simulation,
        slots: Sequence[int],
        air: np.random.Generator,
        hidden: Sequence[HiddenEffect],
        moisture: "Moisture",
    ) -> None:
        seating = stream(sim.seed, "fixture")
        low, high = sim.slot_lag_s
        lag = seating.uniform(low, high, 64)[list(slots)]
        self._gradient = sim.slot_gradient_K * seating.standard_normal(64)[list(slots)]
        self._keep = np.exp(-STEP_S / lag)
        self._air_stream = air
        self._unrest = np.zeros(len(slots))
        self._hidden = list(hidden)
        self._moisture = moisture
        self.chamber = Chamber(room=sim.room_C, ramp_K_min=3.0, air=sim.room_C, wall=sim.room_C, working=sim.room_C)
        self.chamber.set_point = sim.room_C
        self.climate = Climate()
        self.conditioned, self.pressure = Grid(np.array(math.nan)), Grid(np.array(AMBIENT_HPA))
        self._breathing = [effect for effect in self._hidden if effect.breathes]
        self.temperature = Grid(np.full(len(slots), sim.room_C))
        self.air = Grid(np.array(sim.room_C))
        self.vibration = Grid(np.array(self.chamber.vibration()))
        self.memory = [Grid(np.zeros((len(slots), 3))) for _ in self._hidden]

    def humidity(self, time: Array) -> Array:
        """Relative humidity of the air around the devices at instants (n,), %: that of a climate unit, else of the room."""
        conditioned = self.conditioned.at(time)
        return np.where(
            np.isnan(conditioned), self._moisture.relative(time, self.air.at(time)), np.clip(conditioned, 0.0, 100.0)
        )

    def humidity_now(self) -> float:
        """Relative humidity of the air at the newest step, %."""
        now = np.array([(self.temperature.length - 1) * STEP_S])
        room = self._moisture.relative(now, np.array([self.chamber.air]))[0]
        return float(room) if math.isnan(self.climate.humidity) else self.climate.humidity

    def step_to(self, seconds: float, force: Callable[[float], Array]) -> None:
        """Computes the grid up to the whole second at or after ``seconds``; ``force(t)`` is (s, 3) in g."""
        last = math.ceil(seconds / STEP_S)
        while self.temperature.length <= last:
            self._step(force)

    def _step(self, force: Callable[[float], Array]) -> None:
        self.climate.step(STEP_S)
        self.chamber.step(self.climate.store)
        self.conditioned.append(np.array(self.climate.humidity))
        self.pressure.append(np.array(self.climate.pressure))
        keep = math.exp(-STEP_S / AIR_UNREST_S)
        z = self._air_stream.standard_normal(len(self._unrest))
        self._unrest = keep * self._unrest + AIR_UNREST_K * math.sqrt(1.0 - keep**2) * z
        around = self.chamber.air + self._gradient + self._unrest
        elements = around + (self.temperature.last - around) * self._keep
        if self._hidden:
            before = force((self.temperature.length - 1) * STEP_S)
            if self._breathing:
                around_pct = self.humidity_now()
                for effect in self._breathing:
                    effect.surround(around_pct, self.climate.pressure)
            for effect, memory in zip(self._hidden, self.memory, strict=True):
                memory.append(effect.slow(elements, before, STEP_S))
        self.temperature.append(elements)
        self.air.append(np.array(self.chamber.air))
        self.vibration.append(np.array(self.chamber.vibration()))


class Grid:
    """A table with one row of ``shape`` per step."""

    def __init__(self, first: Array) -> None:
        self._rows = np.zeros((1024, *first.shape))
        self._rows[0] = first
        self.length = 1

    def append(self, row: Array) -> None:
        """Appends the row of the next step."""
        if self.length == len(self._rows):
            self._rows = np.concatenate((self._rows, np.zeros_like(self._rows)))
        self._rows[self.length] = row
        self.length += 1

    @property
    def last(self) -> Array:
        """The newest row."""
        return self._rows[self.length - 1]

    def at(self, steps: Array) -> Array:
        """Rows (n, *shape) at ``steps`` (n,), integer or fractional."""
        left = np.minimum(np.floor(steps).astype(np.int64), self.length - 2)
        part = (steps - left).reshape(-1, *(1,) * (self._rows.ndim - 1))
        return self._rows[left] + part * (self._rows[left + 1] - self._rows[left])


class Moisture:
    """Vapour pressure as a function of time; through the port of the chamber it follows that of the room."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._phases = rng.uniform(0.0, 2.0 * np.pi, len(PERIODS_S))
        self._sizes = UNREST * rng.uniform(0.5, 1.0, len(PERIODS_S))

    def pressure(self, time: Array) -> Array:
        """Vapour pressure at instants (n,), hPa."""
        swings = [
            size * np.sin(2.0 * np.pi * time / period + phase)
            for size, period, phase in zip(self._sizes, PERIODS_S, self._phases, strict=True)
        ]
        return np.asarray(ROOM_HPA * (1.0 + np.sum(swings, axis=0)), dtype=np.float64)

    def relative(self, time: Array, air: Array) -> Array:
        """Relative humidity (n,), %, at air temperatures (n,), °C; at most 100 %, as the rest condenses."""
        return np.minimum(100.0 * self.pressure(time) / saturation(air), 100.0)


def saturation(air: Array) -> Array:
    """Saturation vapour pressure over water, hPa: Magnus' formula, coefficients of WMO-No. 8 (2018), annex 4.B."""
    return np.asarray(6.112 * np.exp(17.62 * air / (243.12 + air)), dtype=np.float64)
