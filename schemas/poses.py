"""Attitudes of the table, and which of them are measured at one soak."""

from typing import Annotated

from pydantic import Field

from schemas.bounds import MOST_POSES, Celsius, Degrees, Wait
from schemas.strict import Strict


class Pose(Strict):
    """One attitude of the table: outer angle about the laboratory's x, inner angle about the fixture's z, degrees."""

    name: str
    outer_deg: Degrees
    inner_deg: Degrees


class SoakPart(Strict):
    """What is measured at one soak, where not every pose is measured at every temperature.

    ``poses`` and ``verification`` are numbers in the recipe's lists, from 1, in order of measurement; a pose may come again.
    Left out, all of the list are meant. ``waits_s`` are waits after the move, one for each of ``poses``, in place of the recipe's
    ``settle_s``. With ``settled = false`` the dwells begin at once, while the devices still follow the chamber. ``off_s`` are
    seconds for which the devices are switched off before the move to each of ``poses``; 0 leaves them on.
    """

    temperature_C: Celsius
    poses: Annotated[list[Annotated[int, Field(ge=1)]], Field(max_length=MOST_POSES)] | None = None
    verification: Annotated[list[Annotated[int, Field(ge=1)]], Field(max_length=MOST_POSES)] | None = None
    waits_s: list[Wait] | None = None
    off_s: list[Wait] | None = None
    settled: bool = True
