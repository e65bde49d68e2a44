"""What every kind of fault inherits: nothing happens, unless the kind says so."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from collections.abc import Callable

    from schemas.fault import FaultOrder
    from stations.plant.faults.proxy import Meddling
    from stations.plant.plant import Plant
    from stations.plant.table import Axis

UNIT = "unit"
AXES = ("outer", "inner")
DEVICES = (*AXES, "chamber", "reader")
MUTE = -1  # an answer of this code is none at all


@dataclass
class Fault:
    """One fault of one plant, while it lasts. The fields of a kind are its figures.

    ``about`` says who may be meant: ``unit`` (by its serial number), the station's devices by name; nobody where it is empty.
    What a kind does must follow from the plant's time and from what is written, never from what is read: a resumed plant is
    played through the writes alone.
    """

    kind: ClassVar[str] = ""
    about: ClassVar[tuple[str, ...]] = ()

    fault: FaultOrder = field(init=False, repr=False)
    device_id: int = field(init=False, default=0, repr=False)
    unit: int = field(init=False, default=0, repr=False)

    def begins(self, plant: Plant) -> None:
        """What happens when it begins."""

    def ends(self, plant: Plant) -> None:
        """What happens when it is over."""

    def answers(self) -> int:
        """The exception code with which the device answers everything; 0 where it answers as always."""
        return 0

    def on_read(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """The words that the device tells where it should tell ``words``."""
        del now_us, address
        return words

    def on_write(self, words: list[int], held: list[int] | None, write: Callable[[list[int]], None]) -> int:
        """Does with the words of a write what the device then does, and gives the exception code of its answer.

        ``held`` are the words that the registers hold now, None where they cannot be read.
        """
        del held
        write(words)
        return 0

    def wire_action(self) -> Meddling | None:
        """What happens to frames on the wire."""
        return None

    def axis(self, plant: Plant) -> Axis:
        """The axis that is meant."""
        return plant.outer if self.fault.device == "outer" else plant.inner
