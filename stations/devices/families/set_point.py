"""A controller with a set point only, such as the Watlow EZ-ZONE PM."""

from stations.devices.chamber import AUTOMATIC, ThermalChamber


class SetPointChamber(ThermalChamber):
    """A controller without alarm and program registers; ``actual_mode``, where it exists, must be ``automatic``."""

    def mode(self) -> str:
        """The actual mode; without it the written mode; without both ``automatic``."""
        register = next((name for name in ("actual_mode", "mode") if self._values.has(name)), "")
        return self._values.text(register) if register else AUTOMATIC

    def require_ready(self) -> None:
        """Checks nothing: such a controller reports no state."""
