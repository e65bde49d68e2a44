"""Eurotherm 3200."""

from stations.devices.chamber import AUTOMATIC, ThermalChamber, refuse_program


class EurothermChamber(ThermalChamber):
    """Eurotherm 3200: only the remote set point is written, because writes to the others wear out its memory."""

    needs = ("temperature", "set_point", "remote_enable", "program_status")

    def mode(self) -> str:
        """Automatic while the remote set point is enabled."""
        state = self._values.text("remote_enable")
        return AUTOMATIC if state == "remote" else state

    def require_ready(self) -> None:
        refuse_program(self.name, self._values.text("program_status"))

    def order(self, temperature: float) -> None:
        """Writes the remote set point, then enables it, so that enabling causes no jump."""
        self._values.write("set_point", temperature)
        if self._values.text("remote_enable") != "remote":
            self._values.write("remote_enable", "remote")
