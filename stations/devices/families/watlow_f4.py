"""Watlow F4."""

from stations.devices.chamber import AUTOMATIC, CELSIUS, RUNNING, ThermalChamber, refuse_program


class F4Chamber(ThermalChamber):
    """Watlow F4: integers with the decimals set in the controller; a static set point or a program."""

    needs = (
        "temperature", "set_point", "set_point_low", "set_point_high", "decimals", "status", "temperature_unit", "program_end",
    )  # fmt: skip

    def mode(self) -> str:
        """Automatic while the set point is static: the F4 has no register to switch its loop off."""
        state = self._values.text("status")
        return AUTOMATIC if state.startswith("static") else state

    def require_ready(self) -> None:
        unit = self._values.text("temperature_unit")
        if unit != CELSIUS:
            self.refuse(f"shows {unit}", CELSIUS, "set the controller's unit")
        refuse_program(self.name, self._values.text("status"))

    def off(self) -> None:
        """Ends a running program; a request to switch the loop off is refused, as the F4 cannot do so."""
        if self._values.text("status") in RUNNING:
            self._values.write("program_end", "act")
        super().off()
