"""Shock machines with arm, release and guard door, and a triggered recorder that leaves a result file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from schemas.errors import OperatorNeeded, StationTimeout
from stations.devices.equipment import Equipment
from stations.devices.recording import Recording, RecordingSpoilt
from stations.devices.result_files import read_recording

POLL_S = 0.2
PATIENCE_S = 60.0
PEAK_SHARE = 0.2  # IEC 60068-2-27: peak within ± 20 %


class ShockMachine(Equipment):
    """One shock an order: set, armed, released; the machine disarms itself after the shock."""

    needs: ClassVar[tuple[str, ...]] = (
        "peak",
        "duration",
        "axis",
        "direction",
        "arm",
        "release",
        "door",
        "state",
        "file",
    )

    on: ClassVar[str | int] = "ON"  # what is written, in the form of the controller
    off: ClassVar[str | int] = "OFF"
    now: ClassVar[str | int] = "NOW"

    def shock(self, peak: float, seconds: float, axis: int, direction: int, slots: Sequence[int]) -> Recording:
        """A half sine with a peak in g along an axis (0 to 2), up or against it (direction 1 or −1).

        Raises
        ------
        OperatorNeeded
            The guard door is open.
        RecordingSpoilt
            Missed trigger, clipped reference, or a peak outside ± 20 %.
        """
        if self.values.text("door") != "CLOSED":
            raise OperatorNeeded(
                f"{self.name}: the guard door is open, closed is needed; close it and give the command again"
            )
        for name, value in (
            ("peak", peak),
            ("duration", 1e3 * seconds),
            ("axis", float(axis)),
            ("direction", float(direction)),
        ):
            self.values.write(name, value)
        before = self.values.text("file")
        try:
            state = self._released()
        except BaseException:
            self.make_safe()  # armed, and nobody waits for the shock
            raise
        if state == "DOOR":
            self.make_safe()
            raise OperatorNeeded(
                f"{self.name}: the guard door was opened, the shock was not released; close it, then again"
            )
        path = self.values.text("file")
        if path in {before, "NONE"}:
            raise RecordingSpoilt(f"{self.name}: no recording of the shock, the trigger was missed; check the recorder")
        recording = read_recording(Path(path), list(slots), self.name)
        _refuse_wrong_pulse(recording.reference[:, axis] * direction, peak, self.name)
        return recording

    def _released(self) -> str:
        """Arms and releases; the machine's state after the shock."""
        self.values.write("arm", self.on)
        self.values.write("release", self.now)
        end = self.clock.now() + PATIENCE_S
        while (state := self.values.text("state")) == "RUN":
            if self.clock.now() > end:
                raise StationTimeout(f"{self.name}: no shock within {PATIENCE_S:g} s of the release; check the machine")
            self.clock.sleep(POLL_S)
        return state

    def make_safe(self) -> None:
        """Disarms the machine."""
        self.values.write("arm", self.off)


def _refuse_wrong_pulse(driven: np.ndarray, peak: float, name: str) -> None:
    """Refuse a reference that is clipped, or a peak that was not reached."""
    reached = float(driven.max())
    flat = int(np.count_nonzero(driven > 0.9999 * reached))
    if flat > max(20, 0.02 * int(np.count_nonzero(driven > 0.1 * reached))):
        raise RecordingSpoilt(
            f"{name}: the reference is clipped at {reached:.4g} g; choose a larger range of its conditioner"
        )
    if not abs(reached / peak - 1.0) <= PEAK_SHARE:
        raise RecordingSpoilt(f"{name}: peak {reached:.4g} g, {peak:g} g ± 20 % was ordered; check height or pressure")
