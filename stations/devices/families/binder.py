"""Binder MB1 and MB2."""

from stations.devices.chamber import AUTOMATIC, ThermalChamber, refuse_program


class BinderChamber(ThermalChamber):
    """Binder MB1 and MB2: the active set point is read-only, the others are written."""

    written = ("set_point_basic", "set_point_manual")
    needs = ("temperature", "set_point", "set_point_manual")

    def mode(self) -> str:
        """Basic and manual operation both have a set point; the MB2 reports no mode."""
        mode = self._values.text("mode") if self._values.has("mode") else "manual"
        return AUTOMATIC if mode in {"basic", "manual"} else mode

    def require_ready(self) -> None:
        if self.mode() == "program":
            refuse_program(self.name, "runs")

    def order(self, temperature: float) -> None:
        """Writes every set point of the controller, because sources disagree on which belongs to which mode."""
        for name in self.written:
            if self._values.has(name):
                self._values.write(name, temperature)
