"""Test equipment in a role of a station: exciter, shock machine, centrifuge, power supply, generator of steps; its recordings.

A recording comes from a result file: a MATLAB file with a rate, a unit and slots.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from schemas.errors import OperatorNeeded, StationError, StationRefused, StationTimeout
from schemas.motion import Motion
from schemas.vibration_profile import load_vibration_profile
from stations.clock import Clock
from stations.codec import Value
from stations.devices.commands import Values

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
REFERENCE = "@reference"
REFERENCE_SLOT = 999
NEEDED = ("rate_hz", "reference", "reference_rate_hz", "reference_unit")
STANDARD_GRAVITY = {"g": 1.0, "m/s^2": 9.80665}
FLAT_SHARE = 5e-4  # of the samples of Gaussian vibration within 0.1 % of an extreme: a range of 3.3 σ has so many
FEWEST_FLAT = 20
FLAT_SHARE_OF_SINE = 0.1  # of the samples of a sine: it has less


class RecordingSpoilt(StationError):
    """A recording that is of no use, such as a missed trigger or a clipped reference; it is discarded and taken again."""


@dataclass(frozen=True)
class Recording:
    """The outputs of the units by slot, and the reference sensor, each on its own time base.

    outputs : (n, 3) by slot, unit of the output
    rate_hz : nominal rate of the outputs, Hz; a device with its own clock departs from it
    reference : (m, 3), g, in the axes of the units
    reference_rate_hz : of the reference, Hz
    """

    outputs: dict[int, Array]
    rate_hz: float
    reference: Array
    reference_rate_hz: float

    def reference_frame(self, record: int, start: float) -> "pd.DataFrame":
        """The reference as samples, under a name that no serial can have."""
        import pandas as pd  # a watchdog opens the devices, and has no second for what it never makes

        n = len(self.reference)
        columns = {
            "unit": pd.Series([REFERENCE] * n, dtype="str"),
            "slot": np.full(n, REFERENCE_SLOT, dtype=np.int64),
            "record": np.full(n, record, dtype=np.int64),
            "kind": pd.Series(["procedure"] * n, dtype="str"),
            "time_s": start + (np.arange(n) + 1.0) / self.reference_rate_hz,
        }
        return pd.DataFrame({**columns, **dict(zip("xyz", self.reference[:, :3].T, strict=True))})


def read_recording(path: Path, slots: list[int], name: str, units: Mapping[str, float] = STANDARD_GRAVITY) -> Recording:
    """The recording in a result file; a file without rate or unit is refused.

    slots : whose channels are wanted; missing channels are left out
    name : of the equipment, for messages
    units : allowed units of the reference, with their number per returned unit
    """
    from scipy.io import loadmat  # a third of a second

    try:
        content: dict[str, Any] = loadmat(path, simplify_cells=True)
    except (OSError, ValueError, NotImplementedError) as problem:  # the last: files of MATLAB 7.3, which are HDF5
        raise StationRefused(f"{name}: result file {path.name} cannot be read ({problem}); check the share") from None
    missing = [key for key in NEEDED if key not in content]
    if missing:
        raise StationRefused(
            f"{name}: result file {path.name} lacks {', '.join(missing)}; set up the export of the recorder"
        )
    unit = str(content["reference_unit"])
    if unit not in units:
        raise StationRefused(f"{name}: reference in '{unit}', {' or '.join(units)} is needed; correct the set-up")
    found = ((slot, content[f"slot_{slot}"]) for slot in slots if f"slot_{slot}" in content)
    outputs = {slot: np.atleast_2d(np.asarray(channels, dtype=np.float64)) for slot, channels in found}
    reference = np.asarray(content["reference"], dtype=np.float64) / units[unit]
    return Recording(outputs, float(content["rate_hz"]), reference, float(content["reference_rate_hz"]))


class Equipment(ABC):
    """Equipment in a role of a station; the adapter knows what its commands mean, and nothing of who simulates it."""

    needs: ClassVar[tuple[str, ...]] = ()

    def __init__(self, values: Values, clock: Clock) -> None:
        self.values, self.clock = values, clock
        self.name = values.name

    def write_all(self, **values: Value) -> None:
        """Writes values by their names, each once, in this order."""
        for name, value in values.items():
            self.values.write(name, value)

    def refuse_error(self, order: str, remedy: str) -> None:
        """Refuses an order after which the device reports an error of SCPI."""
        code = self.values.number("error")
        if code != 0.0:
            raise StationRefused(f"{self.name}: error {code:.0f} at {order}, none is needed; {remedy}")

    @abstractmethod
    def make_safe(self) -> None:
        """Leaves it at rest, disarmed: an absolute state, which may be ordered twice."""

    def stand_by(self) -> None:  # noqa: B027 - most equipment is at rest between its own records
        """Brings it to the state for records that do not use it; nothing is sent where it already has this state."""


class RecordingEquipment(Equipment):
    """Equipment with a recorder, which leaves a result file for each test."""

    def ended(self, patience_s: float, poll_s: float, late: str) -> str:
        """The state at the end of a test; :class:`StationTimeout` says ``late`` where it does not end in time."""
        end = self.clock.now() + patience_s
        while (state := self.values.text("state")) == "RUN":
            if self.clock.now() > end:
                raise StationTimeout(f"{self.name}: {late}")
            self.clock.sleep(poll_s)
        return state

    def recorded(
        self, before: str, slots: Sequence[int], what: str = "recording", units: Mapping[str, float] = STANDARD_GRAVITY
    ) -> Recording:
        """The recording of the last test; that of ``before`` means that the recorder has missed its trigger."""
        path = self.values.text("file")
        if path in {before, "NONE"}:
            raise RecordingSpoilt(f"{self.name}: no {what}, the trigger was missed; check the recorder")
        return read_recording(Path(path), list(slots), self.name, units)

    def refuse_sine(self, frequency: float, level_g: float) -> None:
        """Refuse a sine that exceeds the exciter's motion; :class:`OperatorNeeded`, since repeating it changes nothing."""
        motion = self.values.profile.motion or Motion()
        self._refuse(motion.beyond_sine(frequency, level_g), f"{level_g:g} g at {frequency:g} Hz")

    def refuse_random(self, vibration: str, level_g: float) -> None:
        """Refuse a random profile whose three-sigma peaks exceed the exciter's motion; :class:`OperatorNeeded`."""
        motion, points = self.values.profile.motion or Motion(), load_vibration_profile(vibration).breakpoints
        self._refuse(motion.beyond_random(points, level_g), f"{vibration} at {level_g:g} g rms")

    def _refuse(self, why: str, what: str) -> None:
        if why:
            remedy = "lower the level, or correct maximum of the exciter in the station's file"
            raise OperatorNeeded(f"{self.name}: {what}: {why}; {remedy}")

    def refuse_clipped_random(self, driven: Array) -> None:
        """Refuse Gaussian vibration (n,) whose extremes are flat: the conditioner of the reference clips."""
        self.refuse_flat(np.abs(driven - driven.mean()), max(FEWEST_FLAT, FLAT_SHARE * driven.size))

    def refuse_flat(self, size: Array, most: float, near: float = 0.999) -> None:
        """Refuse a reference that lies near its largest size (n,) in more than ``most`` samples: its conditioner clips."""
        top = float(size.max())
        if int(np.count_nonzero(size > near * top)) > most:
            what = f"the reference is clipped at {top:.4g} g; choose a larger range of its conditioner"
            raise RecordingSpoilt(f"{self.name}: {what}")


def tone_level(driven: Array, rate_hz: float, frequency: float) -> tuple[float, float]:
    """Peak value of the tone in a record (n,), and the standard deviation of what is left beside it and its offset."""
    phase = 2.0 * np.pi * frequency * np.arange(driven.size) / rate_hz
    rows = np.column_stack([np.cos(phase), np.sin(phase), np.ones_like(phase)])
    c = np.linalg.lstsq(rows, driven, rcond=None)[0]
    return float(np.hypot(c[0], c[1])), float(np.std(driven - rows @ c))
