"""Test equipment in a role of a station: exciter, shock machine, centrifuge, power supply, generator of steps."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from schemas.errors import StationRefused, StationTimeout
from stations.clock import Clock
from stations.codec import Value
from stations.devices.commands import Values
from stations.devices.recording import STANDARD_GRAVITY, Recording, RecordingSpoilt, read_recording


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
        self,
        before: str,
        slots: Sequence[int],
        what: str = "recording",
        units: Mapping[str, float] = STANDARD_GRAVITY,
    ) -> Recording:
        """The recording of the last test; that of ``before`` means that the recorder has missed its trigger."""
        path = self.values.text("file")
        if path in {before, "NONE"}:
            raise RecordingSpoilt(f"{self.name}: no {what}, the trigger was missed; check the recorder")
        return read_recording(Path(path), list(slots), self.name, units)
