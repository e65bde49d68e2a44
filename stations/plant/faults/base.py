"""The base class of the kinds of faults; each kind overrides what it changes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from schemas.fault import FaultOrder
from stations.plant.table import Axis
from stations.plant.world import World

UNIT = "unit"
AXES = ("outer", "inner")
DEVICES = (*AXES, "chamber", "reader")
MUTE = -1  # in place of an exception code: the device sends no answer


@dataclass
class Fault:
    """One fault of one plant. The fields of a kind are its figures.

    ``targets`` lists what the fault can be given for: ``unit`` (by its serial number) or the station's devices by name; empty
    where the fault has no target. The effect of a kind must depend on the plant's time and on writes only, never on reads: a
    resumed plant replays the writes alone.
    """

    kind: ClassVar[str] = ""
    targets: ClassVar[tuple[str, ...]] = ()
    exception: ClassVar[int] = 0

    order: FaultOrder = field(init=False, repr=False)
    device_id: int = field(init=False, default=0, repr=False)
    unit: int = field(init=False, default=0, repr=False)

    def begins(self, world: World) -> None:
        """Changes the world when the fault begins."""

    def ends(self, world: World) -> None:
        """Changes the world when the fault ends."""

    def answers(self) -> int:
        """The exception code with which the device answers every request; 0 where it answers normally."""
        return self.exception

    def on_read(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """The words that the device reports in place of ``words``."""
        return words

    def on_write(self, words: list[int], held: list[int] | None, write: Callable[[list[int]], None]) -> int:
        """Carries out a write as the faulty device does, and returns the exception code of its answer.

        Parameters
        ----------
        words : the words of the write
        held : the words that the registers hold now; None where they cannot be read
        write : writes words to the registers
        """
        write(words)
        return 0

    def axis(self, world: World) -> Axis:
        """The axis that has the fault."""
        return world.outer if self.order.device == "outer" else world.inner
