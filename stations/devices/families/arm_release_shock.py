"""Shock machines with arm, release and guard door, and a triggered recorder that leaves a result file."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from schemas.errors import OperatorNeeded
from stations.devices.equipment import FEWEST_FLAT, Recording, RecordingEquipment, RecordingSpoilt

POLL_S = 0.2
PATIENCE_S = 60.0
PEAK_SHARE = 0.2  # IEC 60068-2-27: peak within ± 20 %


class ShockMachine(RecordingEquipment):
    """One shock an order: set, armed, released; the machine disarms itself after the shock."""

    needs = (
        "peak", "duration", "axis", "direction", "arm", "release", "door", "state", "file",
    )  # fmt: skip
    on: ClassVar[str | int] = "ON"  # what is written, in the form of the controller
    off: ClassVar[str | int] = "OFF"
    now: ClassVar[str | int] = "NOW"

    def shock(self, peak: float, seconds: float, axis: int, direction: int, slots: Sequence[int]) -> Recording:
        """A half sine with a peak in g along an axis (0 to 2), up or against it (direction 1 or −1).

        Raises OperatorNeeded: the guard door is open.
        Raises RecordingSpoilt: missed trigger, clipped reference, or a peak outside ± 20 %.
        """
        if self.values.text("door") != "CLOSED":
            raise OperatorNeeded(
                f"{self.name}: the guard door is open, closed is needed; close it and give the command again"
            )
        self.write_all(peak=peak, duration=1e3 * seconds, axis=float(axis), direction=float(direction))
        before = self.values.text("file")
        try:
            self.write_all(arm=self.on, release=self.now)
            late = f"no shock within {PATIENCE_S:g} s of the release; check the machine"
            state = self.ended(PATIENCE_S, POLL_S, late)
        except BaseException:
            self.make_safe()  # armed, and nobody waits for the shock
            raise
        if state == "DOOR":
            self.make_safe()
            raise OperatorNeeded(
                f"{self.name}: the guard door was opened, the shock was not released; close it, then again"
            )
        recording = self.recorded(before, slots, "recording of the shock")
        self._refuse_wrong_pulse(recording.reference[:, axis] * direction, peak)
        return recording

    def make_safe(self) -> None:
        self.values.write("arm", self.off)

    def _refuse_wrong_pulse(self, driven: np.ndarray, peak: float) -> None:
        """Refuse a reference that is clipped, or a peak that was not reached."""
        reached = float(driven.max())
        self.refuse_flat(driven, max(FEWEST_FLAT, 0.02 * int(np.count_nonzero(driven > 0.1 * reached))), 0.9999)
        if not abs(reached / peak - 1.0) <= PEAK_SHARE:
            what = f"peak {reached:.4g} g, {peak:g} g ± 20 % was ordered; check height or pressure"
            raise RecordingSpoilt(f"{self.name}: {what}")
