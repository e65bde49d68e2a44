"""IAI ROBO Cylinder controllers in direct numerical mode: the low word of the target starts the move."""

from stations.devices.table import DriveState, TableAxis


class NumericAxis(TableAxis):
    """A ROBO Cylinder controller."""

    needs = (
        "serial_mode", "servo_on", "pause", "alarm_reset", "state", "motion", "target",
        "feedback_position",
    )  # fmt: skip
    coils = ("serial_mode", "servo_on")

    def state(self) -> DriveState:
        """Both status registers, read in one request, and the alarm code where an alarm is active."""
        registers, status = self._registers, self._registers.read_group("state")
        flags, more = (registers.flags_in(name, status[name]) for name in ("status", "extended_status"))
        alarm = f"drive alarm 0x{int(float(str(status['alarm']))):02X}" if flags["alarm"] else ""
        if flags["emergency_stop"]:
            alarm = "emergency stop at the drive"
        ready = flags["ready"] and flags["servo_on"] and not flags["paused"]
        return DriveState(ready, flags["home_end"], more["move"], flags["in_position"] and not more["move"], alarm)

    def order(self, target: float) -> None:
        """Writes band, speed and acceleration and reads them back; then writes the target, whose low word starts the move."""
        registers, limits = self._registers, self._limits
        values = {
            "position_band": max(limits.position_deg, registers.step("target")),
            "speed": limits.speed_deg_s,
            "acceleration": limits.acceleration_deg_s2,
        }
        registers.set_group("motion", values)
        registers.write("target", target)

    def stop(self) -> None:
        """Pauses, resets the alarm, which discards the rest of the move, and ends the pause."""
        for name in ("pause", "alarm_reset"):
            self._registers.write(name, "on")
        for name in ("alarm_reset", "pause"):
            self._registers.write(name, "off")
