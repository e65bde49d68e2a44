"""An arm as the tilt table: its program turns the tool by two angles, and the pose is read from the rotation vector of the TCP.

The registers hold whole milliradians: of a pose each component of the reading is known to ±0.5 mrad, 289 µrad in standard
uncertainty, which belongs into ``pose`` of the station's [uncertainty] beside the arm's own repeatability. It is the
same at every visit of the pose, so the scope there is ``station``.
"""

import math
from collections.abc import Sequence

from stations.devices.table import DriveState, TableAxis

FULL_TURN = 360.0


class ArmAxis(TableAxis):
    """One of the two angles of an arm whose tool stands at Rx(outer)·Rz(inner) in the frame of its base."""

    needs = (
        "rotation", "status", "robot_mode", "program",
        "outer_motion", "outer_order", "inner_motion", "inner_order",
    )  # fmt: skip

    def state(self) -> DriveState:
        """Mode and stops of the controller, and whether its program has carried out the order of this angle."""
        registers = self._registers
        status, mode = registers.names_in("status"), registers.text("robot_mode")
        alarm = "protective stop of the arm" if status["security_stop"] != "none" else ""
        if status["emergency_stop"] != "released":
            alarm = "emergency stop at the arm"
        ready = status["power"] == "on" and registers.text("program") == "running"
        done = registers.text(f"{self.which}_order") == "done"
        return DriveState(ready, mode == "running", not done, done, alarm)

    def order(self, target: float) -> None:
        """Writes angle, speed and acceleration and reads them back; then writes the order, which starts the move."""
        limits, which = self._limits, self.which
        values = {
            f"{which}_target": math.remainder(target, FULL_TURN),
            f"{which}_speed": limits.speed_deg_s,
            f"{which}_acceleration": limits.acceleration_deg_s2,
        }
        self._registers.set_group(f"{which}_motion", values)
        self._registers.write(f"{which}_order", "go")

    def stop(self) -> None:
        """The program stops the joints and forgets the rest."""
        self._registers.write(f"{self.which}_order", "stop")

    def position(self) -> float:
        """The angle of the tool by the rotation of its TCP, degrees, in the turn of the last target."""
        angle = angles_of(self._registers.numbers("rotation"))[self.which == "inner"]
        around = angle if self._target is None else self._target
        return around + math.remainder(angle - around, FULL_TURN)

    @property
    def resolution_deg(self) -> float:
        """Two components of half a step each can add up in an angle."""
        return math.degrees(self._registers.step("rotation")) * math.sqrt(2.0)


def angles_of(vector: Sequence[float]) -> tuple[float, float]:
    """Outer and inner angle, degrees, of the rotation vector (3,) in rad of Rx(outer)·Rz(inner).

    Rodrigues: the first row of the matrix is (cos i, −sin i, 0), the last column (0, −sin o, cos o); what the rounding of the
    registers adds besides is no turn about either of the two axes and is left out.
    """
    x, y, z = vector
    angle = math.hypot(x, y, z)
    sine = math.sin(angle) / angle if angle > 0.0 else 1.0
    rest = (1.0 - math.cos(angle)) / angle**2 if angle > 0.0 else 0.5
    outer = math.atan2(sine * x - rest * y * z, 1.0 - rest * (x * x + y * y))
    inner = math.atan2(sine * z - rest * x * y, 1.0 - rest * (y * y + z * z))
    return math.degrees(outer), math.degrees(inner)
