"""The reader of the devices under test: the clock of their samples and the instruments of the fixture."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from schemas.errors import StationRefused
from schemas.profile import limits_of
from stations.codec import named
from stations.devices.registers import Registers
from stations.devices.slot import Slot

RATE_HZ = 1e-3  # allowed difference of the rate read back
POSSIBLE_C = (-100.0, 250.0)
POSSIBLE_V = (0.5, 60.0)  # no supported device works below; a wrong word order gives values near zero
STRONGEST_G = 50.0


@dataclass(frozen=True)
class Instruments:
    """Readings of the fixture at one instant: temperature and supply by slot, vibration, door and emergency stop.

    recorded : values of the registers that the profile records with every dwell, by column; NaN for an impossible value
    """

    temperature_C: list[float]
    supply_V: list[float]
    vibration_g: float
    door_open: bool = False
    stop_pressed: bool = False
    recorded: Mapping[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True)
class Guarded:
    """Door, emergency stop and vibration at one instant."""

    door_open: bool
    stop_pressed: bool
    vibration_g: float


class Reader:
    """A reader with its slots by number."""

    def __init__(self, registers: Registers, slots: Mapping[int, Slot], fastest_hz: float) -> None:
        self._registers = registers
        self.slots = dict(slots)
        self._fastest = fastest_hz

    def check(self, rate_hz: float) -> None:
        """Refuses a rate outside the limits of the station."""
        if not 0.0 < rate_hz <= self._fastest:
            raise StationRefused(
                f"{self._registers.name}: {rate_hz:g} Hz, up to {self._fastest:g} Hz is allowed; change the recipe"
            )

    def start(self, rate_hz: float) -> None:
        """Starts sampling in all slots at once; the first sample comes one period later."""
        self.check(rate_hz)
        registers = self._registers
        if registers.text("sampling") != "stopped":
            self.stop()
        if not abs(registers.number("rate") - rate_hz) <= RATE_HZ:  # NaN, too
            registers.write("rate", rate_hz)
            actual = registers.number("rate")
            if not abs(actual - rate_hz) <= RATE_HZ:
                raise StationRefused(
                    f"{registers.name}: samples at {actual:g} Hz, {rate_hz:g} Hz is needed; choose a supported rate"
                )
        self._sample("running")
        for slot in self.slots.values():
            slot.begin()

    def stop(self) -> None:
        """Stops sampling; the samples stay in the memories of the slots."""
        self._sample("stopped")

    def _sample(self, state: str) -> None:
        """Starts or stops sampling and reads the state back."""
        self._registers.write("sampling", state)
        actual = self._registers.text("sampling")
        if actual != state:
            raise StationRefused(f"{self._registers.name}: sampling is {actual}, {state} is needed; restart the reader")

    def sampling(self) -> str:
        """State of the sampling: ``running`` or ``stopped``."""
        return self._registers.text("sampling")

    def occupied(self) -> list[int]:
        """Slots with a device in them."""
        mask = int(self._registers.number("occupied"))
        return [slot for slot in range(mask.bit_length()) if mask >> slot & 1]

    def instruments(self) -> Instruments:
        """Temperatures, supplies and vibration now.

        A slot in use with an impossible value gets NaN as its temperature: only its unit is lost. Impossible values of all slots
        are refused, as the reader itself is then read wrongly.
        """
        temperature, supply = self._registers.numbers("temperature"), self._registers.numbers("supply")
        guarded = self.guarded()
        vibration = guarded.vibration_g
        (coldest, hottest), (lowest, highest) = POSSIBLE_C, POSSIBLE_V  # NaN is outside
        inside = {s: coldest < temperature[s] < hottest and lowest < supply[s] < highest for s in self.slots}
        wrong = [slot for slot, is_inside in inside.items() if not is_inside]
        if (wrong and len(wrong) == len(self.slots)) or not 0.0 <= vibration < STRONGEST_G:
            first = min(self.slots, default=0)
            raise StationRefused(
                f"{self._registers.name}: slot {first} at {temperature[first]:g} °C and {supply[first]:g} V, vibration "
                f"{vibration:g} g rms, possible values are needed; check supply, sensors, word order and counts"
            )
        temperatures = [math.nan if slot in wrong else value for slot, value in enumerate(temperature)]
        return Instruments(temperatures, supply, vibration, guarded.door_open, guarded.stop_pressed, self._recorded())

    def _recorded(self) -> dict[str, float]:
        """Values that the profile records with every dwell, by column; NaN outside the bounds of the register."""
        recorded: dict[str, float] = {}
        for register in self._registers.profile.registers:
            if register.column:
                value, (low, high) = self._registers.number(register.name), limits_of(register)
                recorded[register.column] = value if low <= value <= high else math.nan
        return recorded

    def guarded(self) -> Guarded:
        """Door, emergency stop and vibration now, in one request."""
        registers, values = self._registers, self._registers.read_group("guard")
        numbers = {name: registers.number_in(name, values[name]) for name in ("door", "emergency_stop", "vibration")}
        closed = named(registers.profile.register("door"), numbers["door"]) == "closed"
        released = named(registers.profile.register("emergency_stop"), numbers["emergency_stop"]) == "released"
        return Guarded(not closed, not released, float(numbers["vibration"]))

    def since_power(self) -> float:
        """Seconds since power-on of the devices."""
        return self._registers.number("since_power")

    @property
    def switches(self) -> bool:
        """Whether the reader can switch the supply of the devices."""
        return self._registers.has("power")

    def powered(self) -> bool:
        """Whether the supply of the devices is on; always true where the reader cannot switch it."""
        return not self.switches or self._registers.text("power") == "on"

    def require_switch(self) -> None:
        """Refuses a reader that cannot switch the supply of the devices."""
        if not self.switches:
            raise StationRefused(
                f"{self._registers.name}: profile {self._registers.profile.name} has no register 'power', one is needed to "
                "switch the devices off and on; remove off_s from the soaks of the recipe, or add the supply relay to the profile"
            )

    def switch(self, state: Literal["on", "off"]) -> None:
        """Switches the supply of all devices: an absolute state, written once and read back; a repetition changes nothing."""
        self.require_switch()
        self._registers.set("power", state)
