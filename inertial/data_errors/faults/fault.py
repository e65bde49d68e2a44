"""A data fault of one unit, and a test for one kind of them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.data_errors.readings import Readings


@dataclass(frozen=True)
class Fault:
    """A data fault of one unit: its name, its dwells, and the evidence.

    Units and dwells are indices in the lot, also in the text of the evidence: ``{unit[1]}``, ``{dwell[32]}``.
    """

    name: str
    unit: int
    dwells: tuple[int, ...]
    evidence: str

    def named(self, units: Sequence[str], dwells: Sequence[int]) -> "Fault":
        """The fault with serials and numbers of dwells instead of indices in its evidence."""
        return replace(self, evidence=self.evidence.format(unit=units, dwell=dwells))


@dataclass(frozen=True)
class Look:
    """A test for one kind of data fault, the ``LOOK`` of its file.

    find : the faults in the readings of a lot
    names : names of the faults that it finds
    order : priority; if several tests find a fault in a unit, the one with the lowest order is reported
    order_in_one_pose : priority for a record in one pose, with unknown response and possibly repeated outputs; None: not used
    of_missing : whether a fault may consist only of dwells that the unit lacks
    """

    find: Callable[[Readings], Iterator[Fault]]
    names: tuple[str, ...]
    order: int
    order_in_one_pose: int | None = None
    of_missing: bool = False


def missing_dwells(readings: Readings, unit: int) -> tuple[int, ...]:
    """Indices of the dwells that a unit lacks and other units have."""
    return tuple(np.flatnonzero(~readings.there[unit]).tolist())
