"""The units that are measured together."""

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from schemas.bounds import MOST_UNITS, Seed
from schemas.serials import LONGEST_SERIAL, SERIAL_PATTERN
from schemas.strict import Grown, Strict, refuse_repeated


class Unit(Strict):
    """One device under test and the slot of the fixture that it sits in, counted from 0."""

    serial: Annotated[str, Field(min_length=1, max_length=LONGEST_SERIAL, pattern=SERIAL_PATTERN)]
    slot: Annotated[int, Field(ge=0, le=MOST_UNITS)]


MOST_REPEATS = 2**28
"""A deployed run takes seven hexadecimal digits of its id as its number: two runs of one lot must not have the same."""


class Lot(Grown):
    """The units measured together, the kind of device they are, and the seed of a simulated station.

    ``repeat`` counts fresh measurements of the same lot: the devices stay, the noise is new. ``sensor_axes`` is the number of
    axes with an output.
    """

    later: ClassVar[frozenset[str]] = frozenset({"sensor_axes"})

    units: Annotated[list[Unit], Field(min_length=1)]
    device: str
    seed: Seed = 0
    repeat: Annotated[int, Field(ge=0, lt=MOST_REPEATS)] = 0
    sensor_axes: Annotated[int, Field(ge=1, le=3)] = 3

    @model_validator(mode="after")
    def _each_once(self) -> "Lot":
        refuse_repeated((unit.serial for unit in self.units), "serial ", "correct the list of units")
        refuse_repeated((unit.slot for unit in self.units), "slot ", "correct the list of units")
        return self
