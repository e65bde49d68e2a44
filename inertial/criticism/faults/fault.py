"""A data fault of one unit, and a look for one kind of them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.readings import Readings


@dataclass(frozen=True)
class Fault:
    """A data fault of one unit: its name, the places of the dwells in it, and what shows it."""

    name: str
    unit: int
    dwells: tuple[int, ...]
    evidence: str


Look = Callable[[Readings], Iterator[Fault]]


def dwells_of(places: NDArray[np.intp]) -> tuple[int, ...]:
    """Places of dwells, as a fault names them."""
    return tuple(int(place) for place in places)
