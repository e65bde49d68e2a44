"""The fixture in the chamber: temperatures of air and elements, vibration, in steps of a second; humidity at any instant."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from schemas.simulation import Simulation
from stations.plant.chamber import STEP_S, Chamber
from stations.plant.device import stream
from stations.plant.hidden import HiddenEffect

Array = NDArray[np.float64]

AIR_UNREST_K = 0.01
AIR_UNREST_S = 30.0
ROOM_HPA = 12.5  # vapour pressure of a room at 23 °C and 45 %
UNREST = 0.12  # relative amplitude of each variation
PERIODS_S = (1500.0, 4100.0, 11000.0)  # air conditioning, doors, weather


class Fixture:
    """Slots, each with its thermal lag and its place in the air stream. Steps are computed one ahead of the clock.

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
        place = stream(sim.seed, "fixture")
        low, high = sim.slot_lag_s
        lag = place.uniform(low, high, 64)[list(slots)]
        self._gradient = sim.slot_gradient_K * place.standard_normal(64)[list(slots)]
        self._keep = np.exp(-STEP_S / lag)
        self._air_stream = air
        self._unrest = np.zeros(len(slots))
        self._hidden = list(hidden)
        self._moisture = moisture
        self.chamber = Chamber(room=sim.room_C, ramp_K_min=3.0, air=sim.room_C, wall=sim.room_C, working=sim.room_C)
        self.chamber.set_point = sim.room_C
        self.temperature = Grid(np.full(len(slots), sim.room_C))
        self.air = Grid(np.array(sim.room_C))
        self.vibration = Grid(np.array(self.chamber.vibration()))
        self.memory = [Grid(np.zeros((len(slots), 3))) for _ in self._hidden]

    def humidity(self, time: Array) -> Array:
        """Relative humidity of the air around the devices at instants (n,), %."""
        return self._moisture.relative(time, self.air.at(time))

    def step_to(self, seconds: float, force: Callable[[float], Array]) -> None:
        """Computes the grid up to the whole second at or after ``seconds``; ``force(t)`` is (s, 3) in g."""
        last = math.ceil(seconds / STEP_S)
        while self.temperature.length <= last:
            self._step(force)

    def _step(self, force: Callable[[float], Array]) -> None:
        self.chamber.step()
        keep = math.exp(-STEP_S / AIR_UNREST_S)
        z = self._air_stream.standard_normal(len(self._unrest))
        self._unrest = keep * self._unrest + AIR_UNREST_K * math.sqrt(1.0 - keep**2) * z
        around = self.chamber.air + self._gradient + self._unrest
        elements = around + (self.temperature.last - around) * self._keep
        if self._hidden:
            before = force((self.temperature.length - 1) * STEP_S)
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
