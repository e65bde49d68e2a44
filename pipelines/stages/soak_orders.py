"""Orders of soaks that a recipe may take: which temperatures, in what order, and how long that takes."""

from __future__ import annotations

from itertools import pairwise, product
from typing import TYPE_CHECKING

from pipelines.stages.minutes import Standing, soaked

if TYPE_CHECKING:
    from collections.abc import Sequence

    from schemas.station import StationConfig

FEWEST, MOST = 3, 6


def orders(levels: Sequence[float], station: StationConfig, shortest_s: float) -> list[tuple[float, ...]]:
    """Orders of soaks over some temperatures, the quickest first.

    Every one meets all the levels, comes back to one of them (drift parts from temperature there) and turns round at least
    once (hysteresis shows where a temperature is reached from both sides).

    Parameters
    ----------
    levels : °C; with one level a single soak is all there is
    shortest_s : the shortest soak, s
    """
    if len(levels) == 1:
        return [(levels[0],)]
    found = [
        order
        for count in range(FEWEST, MOST + 1)
        for order in product(levels, repeat=count)
        if set(order) == set(levels) and len(order) > len(levels) and _moves(order) and _both_sides(order)
    ]
    return sorted(found, key=lambda order: soak_seconds(order, station, shortest_s))


def _moves(order: Sequence[float]) -> bool:
    return all(a != b for a, b in pairwise(order))


def _both_sides(order: Sequence[float]) -> bool:
    """Whether the temperature both rises and falls."""
    steps = [b - a for a, b in pairwise(order)]
    return min(steps) < 0.0 < max(steps)


def soak_seconds(order: Sequence[float], station: StationConfig, shortest_s: float) -> float:
    """Station time of the soaks alone, s, from the room on."""
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    now, total = Standing(air=room, device=room), 0.0
    for temperature in order:
        waited, now = soaked(now, temperature, station, shortest_s)
        total += waited
    return total
