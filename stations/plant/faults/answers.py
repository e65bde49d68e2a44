"""A device answers everything with an exception."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import AXES, DEVICES, MUTE, UNIT, Fault
from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import WireFault

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass
class ExceptionCode(Fault):
    """A device answers everything with one exception: 4 for a failure, 6 for busy, 2 for a register that is not there."""

    kind: ClassVar[str] = "exception_code"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    code: float = 4.0

    def answers(self) -> int:
        """The code."""
        return int(self.code)


@dataclass
class ExceptionsOff(Fault):
    """A device refuses every write and answers as if it had taken it: its exception answers are switched off (AZ series)."""

    kind: ClassVar[str] = "exceptions_off"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def on_write(self, words: list[int], held: list[int] | None, write: Callable[[list[int]], None]) -> int:
        """Nothing is done, and the answer is the usual one."""
        del words, held, write
        return 0


@dataclass
class Mute(Fault):
    """Nothing at all comes back from a device, and every request runs into its time-out."""

    kind: ClassVar[str] = "mute"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def answers(self) -> int:
        """None."""
        return MUTE


NO_RESPONSE = 11  # gateway target device failed to respond (Modbus Application Protocol 1.1b3, 7)


@dataclass
class Silent(Fault):
    """The gateway says that a device does not answer: a plug pulled out, a supply gone."""

    kind: ClassVar[str] = "silent"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def answers(self) -> int:
        """The gateway's exception."""
        return NO_RESPONSE


@dataclass
class TimeOut(WireFault):
    """The answer to a request is lost on its way: the device has acted, and nobody knows."""

    kind: ClassVar[str] = "time_out"

    def wire_action(self) -> Meddling:
        """Lost."""
        return Meddling("drop")


FAILURE = 4


@dataclass
class PartialWrite(Fault):
    """A device takes the first registers of a write and fails at the rest; what was not written keeps its old value."""

    kind: ClassVar[str] = "partial_write"
    about: ClassVar[tuple[str, ...]] = (*AXES, "chamber", "reader")

    def on_write(self, words: list[int], held: list[int] | None, write: Callable[[list[int]], None]) -> int:
        """The first half is new, the rest as it was; the trigger of a move comes last, so that nothing moves."""
        if len(words) == 1:
            write(words)
            return 0
        if held is not None:
            half = len(words) // 2
            write(words[:half] + held[half:])
        return FAILURE
