"""Orders of soaks that a recipe may take: which temperatures, in what order, and how long that takes."""

from __future__ import annotations

from itertools import pairwise, product
from typing import TYPE_CHECKING

from pipelines.schedule.timing import StationPose, soaked

if TYPE_CHECKING:
    from collections.abc import Sequence

    from schemas.station import StationConfig

FEWEST, MOST = 3, 6
MANY = 250
"""Orders of each length that are looked at, the quickest."""

PRODUCTS = 20000
"""Arrangements of so many soaks over so many temperatures that are gone through at most."""


def orders(
    levels: Sequence[float],
    station: StationConfig,
    shortest_s: float,
    *,
    legal: Sequence[float] = (),
    back: bool = True,
) -> list[tuple[float, ...]]:
    """Orders of soaks over some temperatures, the quickest first.

    Every one meets all the levels, comes back to one temperature (drift parts from temperature there) and turns round at least
    once (hysteresis shows where a temperature is reached from both sides).

    Parameters
    ----------
    levels : °C; with one level a single soak is all there is
    shortest_s : the shortest soak, s
    legal : °C, temperatures that may be soaked at besides
    back : whether coming back and turning round is asked for; orders of fewer soaks are found without
    """
    free = sorted({*levels, *legal})
    if len(free) == 1:
        return [(free[0],)]
    found: list[tuple[float, ...]] = []
    for count in range(FEWEST if back else 1, MOST + 1):
        if len(free) ** count > PRODUCTS:
            break
        own = [o for o in product(free, repeat=count) if set(levels) <= set(o) and _moves(o) and (not back or _back(o))]
        found += sorted(own, key=lambda order: soak_seconds(order, station, shortest_s))[:MANY]
    return sorted(found, key=lambda order: soak_seconds(order, station, shortest_s))


def mirrored(order: Sequence[float]) -> tuple[float, ...]:
    """The same order upside down: hot for cold within its range."""
    middle = min(order) + max(order)
    return tuple(round(middle - t, 3) + 0.0 for t in order)


def _moves(order: Sequence[float]) -> bool:
    return all(a != b for a, b in pairwise(order))


def _back(order: Sequence[float]) -> bool:
    """Whether a temperature is met again, and the temperature both rises and falls."""
    rises = [b > a for a, b in pairwise(order)]
    return len(set(order)) < len(order) and any(rises) and not all(rises)


def soak_seconds(order: Sequence[float], station: StationConfig, shortest_s: float) -> float:
    """Station time of the soaks alone, s, from the room on; every one begins where the one before has settled."""
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    return sum(soaked(StationPose(air=a, device=a), b, station, shortest_s)[0] for a, b in pairwise((room, *order)))
