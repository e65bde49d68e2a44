"""The simulated programmable power supply of the devices."""

import math

from schemas.profile import Profile
from stations.plant.equipment import DONE, UNDEFINED, ScpiDevice
from stations.plant.world import World

MOST_RIPPLE_V = 5.0
DROP = 0.9  # of the set voltage, where the current limit holds it


class Supply(ScpiDevice):
    """Follows its setting at once; in its current limit the voltage is lower."""

    def __init__(self, world: World, profile: Profile) -> None:
        super().__init__()
        self._world = world
        self._nominal = world.preset.supply_V
        self._set = self._nominal
        self._on = True
        self._ripple_V, self._ripple_hz = 0.0, 100.0
        command = profile.command("voltage")
        self._range = (command.minimum or 0.0, command.maximum or 60.0)

    def answer(self, line: str) -> tuple[str, bool]:
        head, _, value = line.removesuffix(";*OPC?").partition(" ")
        reports = {"VOLT?": f"{self._set:.6f}", "MEAS:VOLT?": f"{self._voltage():.6f}", "OUTP?": str(int(self._on))}
        reports |= {"VOLT:RIPP?": f"{self._ripple_V:.6f}", "VOLT:RIPP:FREQ?": f"{self._ripple_hz:.6g}"}
        reports["MEAS:VOLT:AC?"] = f"{self._ripple_V / math.sqrt(2.0):.6f}"
        if line in reports:
            return reports[line], False
        if line == "SYST:ERR?":
            return self.told_error()
        if head == "VOLT":
            self._set = self.ordered(value, *self._range, self._set)
        elif head == "VOLT:RIPP":
            self._ripple_V = self.ordered(value, 0.0, MOST_RIPPLE_V, self._ripple_V)
        elif head == "VOLT:RIPP:FREQ":
            self._ripple_hz = self.ordered(value, 1.0, 2e4, self._ripple_hz)
        elif head == "OUTP" and value in {"ON", "OFF"}:
            self._on = value == "ON"
        elif head == "*RCL" and value == "1":
            self._set = self._nominal
        elif line != "*OPC?":
            self.error = UNDEFINED
        world = self._world
        world.scale_supply(range(len(world.slots)), self._voltage() / self._nominal)
        world.set_ripple(self._ripple_V if self._on else 0.0, self._ripple_hz)
        return DONE, line != "*OPC?"

    def _voltage(self) -> float:
        limited = "current_limit" in self._world.bench.conditions and self._set > self._nominal
        return (DROP if limited else 1.0) * self._set if self._on else 0.0


simulated = Supply
