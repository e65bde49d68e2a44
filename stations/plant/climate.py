"""What a climate unit does to the air of the chamber: dampers to stores of hot and cold air, humidifier, vacuum pump."""

import math
from dataclasses import dataclass, field

AMBIENT_HPA = 1013.25
DAMPER_S = 20.0  # the chamber's air behind that of the store
WATER_S = 60.0  # humidity behind its order


@dataclass(frozen=True)
class Leg:
    """Air at °C, relative humidity in % (NaN: that of the room) and pressure in hPa, reached on straight lines, then held."""

    temperature: float
    humidity: float
    pressure: float
    change_s: float
    hold_s: float


@dataclass
class Climate:
    """Stepped once a second, as the chamber; between legs the humidity and the pressure stay, and the dampers are closed.

    store : °C of the air that the dampers let in, NaN while they are closed
    """

    store: float = math.nan
    humidity: float = math.nan
    pressure: float = AMBIENT_HPA
    _leg: Leg | None = None
    _from: tuple[float, float, float] = (0.0, 0.0, AMBIENT_HPA)
    _gone: float = field(default=0.0, init=False)

    def begin(self, leg: Leg, air: float, room_pct: float) -> None:
        """Starts a leg from the air and the humidity that there are."""
        humidity = room_pct if math.isnan(self.humidity) else self.humidity
        self._leg, self._from, self._gone = leg, (air, humidity, self.pressure), 0.0

    def vent(self) -> None:
        """Opens the chamber to the room."""
        self._leg, self.store, self.humidity, self.pressure = None, math.nan, math.nan, AMBIENT_HPA

    def step(self, seconds: float) -> None:
        """Advances by ``seconds``."""
        leg = self._leg
        if leg is None:
            return
        self._gone += seconds
        part = min(1.0, self._gone / leg.change_s)
        air, humidity, pressure = self._from
        self.store = air + part * (leg.temperature - air)
        self.pressure = pressure + part * (leg.pressure - pressure)
        if math.isnan(leg.humidity):
            self.humidity = math.nan
        else:
            ordered = humidity + part * (leg.humidity - humidity)
            now = humidity if math.isnan(self.humidity) else self.humidity
            self.humidity = now + (ordered - now) * seconds / WATER_S
        if self._gone >= leg.change_s + leg.hold_s:
            self._leg, self.store = None, math.nan
