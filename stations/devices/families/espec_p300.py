"""ESPEC P300."""

from schemas.errors import OperatorNeeded
from stations.devices.chamber import ThermalChamber, refuse_program


class P300Chamber(ThermalChamber):
    """ESPEC P300: text protocol, constant operation."""

    needs = ("temperature", "set_point", "set_point_low", "set_point_high", "mode", "alarms")
    running = "CONSTANT"
    standing = "STANDBY"

    def mode(self) -> str:
        """OFF, STANDBY, CONSTANT, or RUN while a program runs."""
        return self._values.text("mode")

    def require_ready(self) -> None:
        count = int(self._values.number("alarms"))
        if count:
            raise OperatorNeeded(f"{self.name}: {count} alarms, none is needed; clear the cause at the panel")
        if self.mode().startswith(("RUN", "RMT")):
            refuse_program(self.name, "runs")

    def order(self, temperature: float) -> None:
        """Writes the set point, then selects constant operation where the chamber is in standby."""
        self._values.write("set_point", temperature)
        if self.mode() != self.running:
            self._values.write("mode", self.running)
