"""Oriental Motor's AZ drives, by direct data: all of a move in one request, its trigger among it."""

from __future__ import annotations

from typing import ClassVar

from stations.devices.axis import DriveState, TableAxis


class DirectDataAxis(TableAxis):
    """An AZ drive. A request that fails may leave some of its registers written; the trigger comes last, so nothing has moved."""

    needs: ClassVar[tuple[str, ...]] = ("direct_data", "command", "status", "alarm", "feedback_position")

    def state(self) -> DriveState:
        """Status bits; the alarm's code where there is one."""
        flags = self._registers.flags("status")
        alarm = f"drive alarm 0x{int(self._registers.number('alarm')):02X}" if flags["alarm"] else ""
        return DriveState(flags["ready"], flags["home_end"], flags["move"], flags["in_position"], alarm)

    def prepare(self) -> None:
        """Nothing: an AZ drive takes direct data as soon as it is ready."""

    def order(self, target: float) -> None:
        """One request with the trigger at its end."""
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
        """The STOP input, up and down again."""
        bit = self._registers.profile.register("command").bits["stop"]
        self._registers.write("command", 1 << bit)
        self._registers.write("command", 0)
