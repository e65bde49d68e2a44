"""SMC LEC controllers: coils enable the drive, step data are read back, then the start register is written alone."""

from stations.devices.table import DriveState, TableAxis


class StepDataAxis(TableAxis):
    """A LECP6 with a rotary table."""

    needs = (
        "serial_mode", "servo_on", "reset", "state", "step_data", "start", "feedback_position",
    )  # fmt: skip
    coils = ("serial_mode", "servo_on")

    def state(self) -> DriveState:
        """Discrete inputs, read in one request; a move has ended when BUSY is off and INP is on."""
        inputs = self._registers.names_in("state")
        alarm = "drive alarm" if inputs["alarm"] != "none" else ""
        if inputs["emergency_stop"] != "released":
            alarm = "emergency stop at the drive"
        busy, arrived = inputs["busy"] == "on", inputs["in_position"] == "on"
        return DriveState(inputs["servo_ready"] == "on", inputs["homed"] == "on", busy, arrived and not busy, alarm)

    def order(self, target: float) -> None:
        """Writes the step data, which start no move, and reads them back; then writes the start register."""
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
        """RESET during a move: the drive decelerates, holds, and discards the rest of the move."""
        self._registers.write("reset", "on")
        self._registers.write("reset", "off")
