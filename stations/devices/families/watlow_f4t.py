"""Watlow F4T."""

from schemas.errors import OperatorNeeded
from stations.devices.chamber import CELSIUS, RUNNING, ThermalChamber, refuse_program


class F4TChamber(ThermalChamber):
    """Watlow F4T: 32-bit floats, a loop mode, programs, alarms."""

    needs = (
        "temperature", "set_point", "set_point_low", "set_point_high", "mode", "actual_mode", "alarm_1", "temperature_unit",
        "program_state", "program_end",
    )  # fmt: skip

    def mode(self) -> str:
        return self._values.text("actual_mode")

    def require_ready(self) -> None:
        unit, alarm = self._values.text("temperature_unit"), self._values.text("alarm_1")
        if unit != CELSIUS:
            self.refuse(f"shows {unit}", CELSIUS, "set the controller's unit")
        if not alarm.startswith("inactive"):
            raise OperatorNeeded(f"{self.name}: alarm 1 in state {alarm}, none is needed; clear the cause at the panel")
        refuse_program(self.name, self._values.text("program_state"))

    def off(self) -> None:
        if self._values.text("program_state") in RUNNING:
            self._values.write("program_end", "act")
        super().off()
