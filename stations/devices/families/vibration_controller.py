"""Vibration controllers that a host selects, starts and reads over lines of text, with the recording in a result file."""

from collections.abc import Sequence

import numpy as np

from schemas.errors import OperatorNeeded, StationTimeout
from stations.devices.equipment import FLAT_SHARE_OF_SINE, Recording, RecordingEquipment, RecordingSpoilt

POLL_S = 0.5
GRACE_S = 30.0
LEVEL_SHARE = 0.3  # by which the level that was reached may depart from the order


class VibrationController(RecordingEquipment):
    """Runs its own closed loop; the host orders finite tests, so that an exciter that is left alone stops by itself."""

    needs = (
        "frequency", "level", "duration", "axis", "turn", "start", "stop", "state", "reason", "file",
    )  # fmt: skip

    def sine(self, frequency: float, level: float, axis: int, seconds: float, slots: Sequence[int]) -> Recording:
        """A dwell at one frequency in Hz with a peak level in g, along an axis (0 to 2) of the units.

        Raises RecordingSpoilt: missed trigger, clipped reference, or a level that was not reached.
        Raises OperatorNeeded: the controller has aborted: its interlock or a limit must be looked after first; or the order
            is beyond the exciter.
        """
        self.refuse_sine(frequency, level)
        self.write_all(frequency=frequency, level=level, duration=seconds, axis=float(axis))
        recording = self._run("SINE", seconds, slots)
        self._refuse_wrong_sine(recording.reference[:, axis], frequency, level)
        return recording

    def sine_across(
        self, frequency: float, level: float, axis: int, angle_deg: float, seconds: float, slots: Sequence[int]
    ) -> Recording:
        """A dwell with the motion across an axis (0 to 2), about which the fixture has turned the units by an angle in degrees.

        At 0° the motion is along the next axis (x after z), at 90° along the axis after that.

        Raises RecordingSpoilt, OperatorNeeded: as for :meth:`sine`.
        """
        self.refuse_sine(frequency, level)
        self.write_all(frequency=frequency, level=level, duration=seconds, axis=float(axis), turn=angle_deg)
        recording = self._run("ACROSS", seconds, slots)
        turn, (next_axis, after_next) = np.radians(angle_deg), (recording.reference[:, (axis + k) % 3] for k in (1, 2))
        self._refuse_wrong_sine(next_axis * np.cos(turn) + after_next * np.sin(turn), frequency, level)
        return recording

    def random(self, profile: str, level: float, axis: int, seconds: float, slots: Sequence[int]) -> Recording:
        """Random vibration by a profile that the controller has, ``level`` in g rms.

        Raises RecordingSpoilt, OperatorNeeded: as for :meth:`sine`; the exciter must follow peaks of three sigma.
        """
        self.refuse_random(profile, level)
        self.write_all(profile=profile, level=level, duration=seconds, axis=float(axis))
        recording = self._run("RANDOM", seconds, slots)
        driven = recording.reference[:, axis]
        n = len(driven)
        self.refuse_clipped_random(driven)
        reached = float(np.std(driven[n // 4 : 3 * n // 4]))
        if not abs(reached / level - 1.0) <= LEVEL_SHARE:
            raise RecordingSpoilt(
                f"{self.name}: {reached:.4g} g rms, {level:g} g rms was ordered; check amplifier and fixture"
            )
        return recording

    def make_safe(self) -> None:
        self.values.write("stop", "NOW")

    def _run(self, kind: str, seconds: float, slots: Sequence[int]) -> Recording:
        before = self.values.text("file")
        self.values.write("start", kind)
        late = f"still runs {GRACE_S:g} s after the end of the test; check the controller"
        try:
            state = self.ended(seconds + GRACE_S, min(POLL_S, max(0.02, seconds)), late)
        except StationTimeout:
            self.make_safe()
            raise
        if state == "ABORT":
            raise OperatorNeeded(
                f"{self.name}: aborted the test ({self.values.text('reason')}); remove the cause, reset the controller, and give "
                "the command again"
            )
        return self.recorded(before, slots, "recording of the test")

    def _refuse_wrong_sine(self, reference: np.ndarray, frequency: float, level: float) -> None:
        """Refuse a reference (n,) in g whose extremes are flat, or whose level is not that which was ordered."""
        driven = reference - reference.mean()
        self.refuse_flat(np.abs(driven), FLAT_SHARE_OF_SINE * driven.size)
        reached = float(np.sqrt(2.0 * np.mean(driven**2)))
        if not abs(reached / level - 1.0) <= LEVEL_SHARE:
            what = f"{reached:.4g} g at {frequency:g} Hz, {level:g} g was ordered; check amplifier and fixture"
            raise RecordingSpoilt(f"{self.name}: {what}")
