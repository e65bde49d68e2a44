"""Oriental Motor AZ drives in direct data operation: one request holds the whole move with its trigger."""

from stations.devices.table import DriveState, TableAxis


class DirectDataAxis(TableAxis):
    """An AZ drive: it accepts direct data as soon as it is ready.

    A failed request may have written some of its registers; the trigger comes last, so nothing has moved.
    """

    needs = ("direct_data", "command", "status", "alarm", "feedback_position")

    def state(self) -> DriveState:
        """Status bits, and the alarm code where an alarm is active."""
        flags = self._registers.flags("status")
        alarm = f"drive alarm 0x{int(self._registers.number('alarm')):02X}" if flags["alarm"] else ""
        return DriveState(flags["ready"], flags["home_end"], flags["move"], flags["in_position"], alarm)

    def order(self, target: float) -> None:
        """Sends one request with the trigger at its end."""
        limits = self._limits
        values = {
            "data_number": 0,
            "operation_type": "absolute",
            "target": target,
            "speed": limits.speed_deg_s,
            "acceleration": limits.acceleration_deg_s2,
            "deceleration": limits.acceleration_deg_s2,
            "current": 100.0,
            "trigger": "all",
            "forwarding": 0,
        }
        self._registers.write_group("direct_data", values)

    def stop(self) -> None:
        """Sets and clears the STOP input."""
        bit = self._registers.profile.register("command").bits["stop"]
        self._registers.write("command", 1 << bit)
        self._registers.write("command", 0)
