"""Function generator with a multichannel recorder, by SCPI: before an exciter's amplifier, or at the self-test inputs."""

from collections.abc import Sequence

import numpy as np

from schemas.errors import OperatorNeeded
from stations.devices.equipment import (
    FLAT_SHARE_OF_SINE,
    STANDARD_GRAVITY,
    Recording,
    RecordingEquipment,
    RecordingSpoilt,
    tone_level,
)

POLL_S = 0.05
GRACE_S = 30.0
FIRST_V = 0.02  # amplitude of the first burst, since the gain of amplifier and exciter is not known
MOST_V = 10.0  # where the profile states no largest amplitude
LARGEST_RISE = 10.0  # of the drive from one burst to the next
FOLLOWS = 2.0  # factor by which the level may depart from the drive times the gain of the burst before
SEEN = 6.0  # standard uncertainties by which a tone must exceed the noise of the reference
ROUNDS = 7
LEVEL_SHARE = 0.05  # by which the level may depart from the order when the loop ends
TRY_S = 0.1
VOLT = {"V": 1.0}
SHARE_OF_DRIVE = 0.2


class ScpiGenerator(RecordingEquipment):
    """Bursts of a finite number of cycles, so that an exciter that is left alone stops; the recorder is triggered by the burst.

    The generator runs open loop: the adapter finds the amplitude from the level that the reference shows.
    """

    needs = (
        "function", "frequency", "amplitude", "cycles", "output", "length", "before", "axis", "start", "state", "error", "file",
    )  # fmt: skip

    def sine(self, frequency: float, level: float, axis: int, seconds: float, slots: Sequence[int]) -> Recording:
        """A dwell at one frequency in Hz with a peak level in g, along an axis (0 to 2) of the units.

        Raises RecordingSpoilt: missed trigger, clipped reference, or a level that is not reached.
        Raises OperatorNeeded: the amplifier reports a fault, the reference does not follow the drive, or the level is beyond
            the exciter or the largest amplitude of the generator.
        """
        self.refuse_sine(frequency, level)
        self.write_all(function="SIN", frequency=frequency, axis=float(axis), before=0.0)
        volts = self._drive_volts(frequency, level, axis, slots)
        recording = self._record(volts, frequency, seconds, slots)
        reached = self._level(recording, axis, frequency)
        if not abs(reached / level - 1.0) <= 2.0 * LEVEL_SHARE:
            raise RecordingSpoilt(
                f"{self.name}: {reached:.4g} g at {frequency:g} Hz with {volts:.3g} V, {level:g} g was ordered; check amplifier "
                "and fixture"
            )
        return recording

    def _drive_volts(self, frequency: float, level: float, axis: int, slots: Sequence[int]) -> float:
        """The amplitude in V that gives the level.

        A reference whose cable is loose shows too little, so the drive must not be raised for that alone: it rises tenfold at
        most, the reference must show a tone after the second burst, and each later level must follow the drive.
        """
        stated = self.values.profile.entry("amplitude").maximum
        most = MOST_V if stated is None else stated
        volts, gain, silent = min(FIRST_V, most), 0.0, False
        for _ in range(ROUNDS):
            trial = self._record(volts, frequency, max(TRY_S, 8.0 / frequency), slots)
            reached = self._level(trial, axis, frequency)
            if reached == 0.0 and (silent or gain > 0.0):
                self._refuse_reference(f"no tone at {frequency:g} Hz with {volts:.3g} V")
            if gain > 0.0 and not 1.0 / FOLLOWS <= reached / (gain * volts) <= FOLLOWS:
                self._refuse_reference(
                    f"{reached:.3g} g at {frequency:g} Hz with {volts:.3g} V, {gain * volts:.3g} g by the burst before"
                )
            if abs(reached / level - 1.0) <= LEVEL_SHARE:
                return volts
            silent, gain = reached == 0.0, reached / volts
            wanted = volts * min(LARGEST_RISE, level / reached if reached > 0.0 else LARGEST_RISE)
            if wanted > most:
                raise OperatorNeeded(
                    f"{self.name}: {level:g} g at {frequency:g} Hz needs {level / gain if gain else wanted:.3g} V, at most "
                    f"{most:g} V is allowed; check the amplifier's gain and the cable of the reference sensor, or lower the level"
                )
            volts = wanted
        return volts

    def _refuse_reference(self, shown: str) -> None:
        raise OperatorNeeded(
            f"{self.name}: the reference shows {shown}; check the cable of the reference sensor, its conditioner and the "
            "amplifier before the drive is raised"
        )

    def step(self, volts: float, hold_s: float, before_s: float, slots: Sequence[int]) -> Recording:
        """One step of voltage that is held, recorded from ``before_s`` before its edge; the reference is the drive in V.

        Raises RecordingSpoilt: missed trigger, or a drive that did not reach its voltage.
        """
        self.write_all(function="SQU", frequency=0.5 / hold_s, before=before_s)
        recording = self._record(volts, 0.5 / hold_s, before_s + 1.5 * hold_s, slots, cycles=1.0)
        driven = float(np.ptp(recording.reference[:, 0]))
        if not abs(driven / volts - 1.0) <= SHARE_OF_DRIVE:
            raise RecordingSpoilt(
                f"{self.name}: a step of {driven:.4g} V in the recorded drive, {volts:g} V was ordered; check load and cable"
            )
        return recording

    def make_safe(self) -> None:
        self.values.write("output", "OFF")

    def _record(
        self, volts: float, frequency: float, seconds: float, slots: Sequence[int], cycles: float = 0.0
    ) -> Recording:
        before = self.values.text("file")
        cycles = cycles or float(np.ceil(frequency * (seconds + 0.5)) + 1.0)
        self.write_all(amplitude=volts, length=seconds, cycles=cycles)
        late = f"still records {GRACE_S:g} s after the end; check the recorder"
        try:
            self.write_all(output="ON", start="NOW")
            self.refuse_error(f"{volts:.4g} V at {frequency:.4g} Hz", "check its ranges")
            state = self.ended(seconds + GRACE_S, POLL_S, late)
        finally:
            self.make_safe()
        if state == "FAULT":
            raise OperatorNeeded(
                f"{self.name}: the amplifier reports a fault; remove its cause, reset it, and give the command again"
            )
        units = VOLT if self.values.profile.kind == "step_generator" else STANDARD_GRAVITY
        return self.recorded(before, slots, units=units)

    def _level(self, recording: Recording, axis: int, frequency: float) -> float:
        """Peak level in g of the tone in the reference, 0 where noise hides it; a clipped reference is refused."""
        driven = recording.reference[:, axis] - recording.reference[:, axis].mean()
        level, noise = tone_level(driven, recording.reference_rate_hz, frequency)
        if level <= SEEN * noise * np.sqrt(2.0 / driven.size):
            return 0.0
        self.refuse_flat(np.abs(driven), FLAT_SHARE_OF_SINE * driven.size)
        return level
