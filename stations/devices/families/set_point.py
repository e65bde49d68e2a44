"""A controller with a set point and nothing else, such as Watlow's EZ-ZONE PM."""

from __future__ import annotations

from stations.devices.chamber import AUTOMATIC, ThermalChamber


class SetPointChamber(ThermalChamber):
    """A controller that reports no alarm and no program; where it has ``actual_mode``, that must be ``automatic``."""

    def mode(self) -> str:
        """The actual mode, else the mode that was set, else automatic where the controller reports none."""
        register = next((name for name in ("actual_mode", "mode") if self._values.has(name)), "")
        return self._values.text(register) if register else AUTOMATIC

    def require_ready(self) -> None:
        """Checks nothing: such a controller reports no state."""
