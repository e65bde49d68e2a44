"""Faults of a device's answers: exceptions, no answer, writes that are ignored or incomplete."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import AXES, DEVICES, MUTE, UNIT, Fault


@dataclass
class ExceptionCode(Fault):
    """A device answers every request with one exception: 4 for failure, 6 for busy, 2 for an unknown register."""

    kind: ClassVar[str] = "exception_code"
    targets: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    code: float = 4.0

    def answers(self) -> int:
        """The code."""
        return int(self.code)


@dataclass
class ExceptionsOff(Fault):
    """A device ignores every write and acknowledges it: its exception responses are switched off (AZ series)."""

    kind: ClassVar[str] = "exceptions_off"
    targets: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def on_write(self, words: list[int], held: list[int] | None, write: Callable[[list[int]], None]) -> int:
        """Writes nothing and acknowledges."""
        return 0


@dataclass
class Mute(Fault):
    """A device sends no answer; every request times out."""

    kind: ClassVar[str] = "mute"
    targets: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)
    exception: ClassVar[int] = MUTE


@dataclass
class Silent(Fault):
    """The gateway reports that a device does not respond: unplugged, or without supply."""

    kind: ClassVar[str] = "silent"
    targets: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)
    exception: ClassVar[int] = 11  # gateway target device failed to respond (Modbus Application Protocol 1.1b3, 7)


@dataclass
class PartialWrite(Fault):
    """A device writes the first registers of a request and fails at the rest, which keep their old values."""

    kind: ClassVar[str] = "partial_write"
    targets: ClassVar[tuple[str, ...]] = (*AXES, "chamber", "reader")

    def on_write(self, words: list[int], held: list[int] | None, write: Callable[[list[int]], None]) -> int:
        """Writes the first half; the trigger of a move is the last register, so nothing moves."""
        if len(words) == 1:
            write(words)
            return 0
        if held is not None:
            half = len(words) // 2
            write(words[:half] + held[half:])
        return 4  # server device failure
