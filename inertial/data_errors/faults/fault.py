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


Look = Callable[[Readings], Iterator[Fault]]


def places_of(places: NDArray[np.intp]) -> tuple[int, ...]:
    """Places of dwells, as listed in a fault."""
    return tuple(int(place) for place in places)
