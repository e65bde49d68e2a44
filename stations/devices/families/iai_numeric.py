"""IAI's ROBO Cylinder controllers, by numbers: the move starts with the low word of its target."""

from __future__ import annotations

from typing import ClassVar

from stations.devices.axis import DriveState, TableAxis


class NumericAxis(TableAxis):
    """A ROBO Cylinder controller."""

    needs: ClassVar[tuple[str, ...]] = (
        "serial_mode", "servo_on", "pause", "alarm_reset", "state", "motion", "target",
        "feedback_position",
    )  # fmt: skip

    def state(self) -> DriveState:
        """Both status registers, of one instant; the alarm's code where there is one."""
        registers, found = self._registers, self._registers.read_group("state")
        flags, more = (registers.flags_in(name, found[name]) for name in ("status", "extended_status"))
        alarm = f"drive alarm 0x{int(float(str(found['alarm']))):02X}" if flags["alarm"] else ""
        if flags["emergency_stop"]:
            alarm = "emergency stop at the drive"
        ready = flags["ready"] and flags["servo_on"] and not flags["paused"]
        return DriveState(ready, flags["home_end"], more["move"], flags["in_position"] and not more["move"], alarm)

    def prepare(self) -> None:
        """Selects the serial line as the source of commands and switches the servo on."""
        for coil in ("serial_mode", "servo_on"):
            if self._registers.text(coil) != "on":
                self._registers.set(coil, "on")

    def order(self, target: float) -> None:
        """Band, speed and acceleration, read back; then the target, whose low word starts the move, in one request."""
        registers, limits = self._registers, self._limits
        values = {
            "position_band": max(limits.position_deg, registers.step("target")),
            "speed": limits.speed_deg_s,
            "acceleration": limits.acceleration_deg_s2,
        }
        registers.set_group("motion", values)
        registers.write("target", target)

    def stop(self) -> None:
        """A pause, and an alarm reset during it, which discards the rest of the move; then the pause ends."""
        for name in ("pause", "alarm_reset"):
            self._registers.write(name, "on")
        for name in ("alarm_reset", "pause"):
            self._registers.write(name, "off")
