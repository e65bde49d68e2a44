"""SMC's LEC controllers: coils to make it ready, step data read back, then a start register that is written alone."""

from __future__ import annotations

from typing import ClassVar

from stations.devices.axis import DriveState, TableAxis


class StepDataAxis(TableAxis):
    """A LECP6 with a rotary table."""

    needs: ClassVar[tuple[str, ...]] = (
        "serial_mode", "servo_on", "reset", "busy", "servo_ready", "homed", "in_position", "alarm", "emergency_stop",
        "step_data", "start", "feedback_position",
    )  # fmt: skip

    def state(self) -> DriveState:
        """Discrete inputs by their names; a move is over when BUSY is off and INP on."""
        registers = self._registers
        alarm = "drive alarm" if registers.text("alarm") != "none" else ""
        if registers.text("emergency_stop") != "released":
            alarm = "emergency stop at the drive"
        on = {name: registers.text(name) == "on" for name in ("busy", "servo_ready", "homed", "in_position")}
        return DriveState(on["servo_ready"], on["homed"], on["busy"], on["in_position"] and not on["busy"], alarm)

    def prepare(self) -> None:
        """Orders from this line instead of the plug, and the servo on."""
        for coil in ("serial_mode", "servo_on"):
            if self._registers.text(coil) != "on":
                self._registers.set(coil, "on")

    def order(self, target: float) -> None:
        """The step data, which move nothing, read back; then the start."""
        registers, limits = self._registers, self._limits
        values = {
            "operation_type": "absolute",
            "speed": limits.speed_deg_s,
            "target": target,
            "acceleration": limits.acceleration_deg_s2,
            "deceleration": limits.acceleration_deg_s2,
            "pushing_force": 0.0,
            "trigger_level": 0.0,
            "pushing_speed": 0.0,
            "moving_force": 100.0,
            "area_1": 0.0,
            "area_2": 0.0,
            "position_band": max(limits.position_deg, registers.step("target")),
        }
        registers.set_group("step_data", values)
        registers.write("start", "go")

    def stop(self) -> None:
        """RESET during a move: it slows down, holds, and the rest of the move is dropped."""
        self._registers.write("reset", "on")
        self._registers.write("reset", "off")
