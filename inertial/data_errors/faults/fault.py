"""A data fault of one unit, and a test for one kind of them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.data_errors.readings import Readings


@dataclass(frozen=True)
class Fault:
    """A data fault of one unit: its name, its dwells, and the evidence."""

    name: str
    unit: int
    dwells: tuple[int, ...]
    evidence: str


Find = Callable[[Readings], Iterator[Fault]]


@dataclass(frozen=True)
class Look:
    """A test for one kind of fault.

    find : the faults in the readings of a lot
    order : in which the tests are made; the first that finds a fault of a unit decides
    in_one_pose : whether it holds for a record in one pose too, whose response is unknown, and whose output may repeat
    """

    find: Find
    order: int
    in_one_pose: bool


def look(order: int, *, in_one_pose: bool = False) -> Callable[[Find], Look]:
    """Makes a function a test for a fault: it is found in any module of this package, and nothing else names it."""
    return lambda find: Look(find, order, in_one_pose)


def places_of(places: NDArray[np.intp]) -> tuple[int, ...]:
    """Places of dwells, as listed in a fault."""
    return tuple(int(place) for place in places)
