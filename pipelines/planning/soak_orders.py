"""Orders of soaks and of ramps for a recipe: temperatures, their order, and the station time they take."""

from collections.abc import Sequence
from itertools import pairwise, product

from pipelines.planning.requirement import Requirement
from pipelines.schedule.timing import StationPose, soaked
from schemas.station import StationConfig

FEWEST, MOST = 3, 6
MANY = 250  # number of orders of each length to consider, the quickest ones
RAMPS = (2, 3, 4, 5)  # numbers of ramps in turn that are tried
PRODUCTS = 20000  # maximum number of arrangements of a given number of soaks to enumerate


def orders(
    requirement: Requirement, station: StationConfig, shortest_s: float, *, ramp: bool = False
) -> list[tuple[float, ...]]:
    """Orders of soaks of at least ``shortest_s`` s, the quickest first; of ramps where ``ramp``.

    Every order includes the levels of the requirement; a single one, without optional ones, gives one order of one soak. Except
    for the discrimination of rivals it repeats at least one temperature (which separates drift from temperature) and both rises
    and falls (which makes hysteresis visible).
    """
    if ramp:
        return ramp_orders(requirement.levels)
    levels, back = requirement.levels, requirement.discrimination is None
    free = sorted({*levels, *requirement.optional_levels})
    if len(free) == 1:
        return [(free[0],)]
    candidates: list[tuple[float, ...]] = []
    for count in range(FEWEST if back else 1, MOST + 1):
        if len(free) ** count > PRODUCTS:
            break
        own = [
            o
            for o in product(free, repeat=count)
            if set(levels) <= set(o) and all(a != b for a, b in pairwise(o)) and (not back or _returns(o))
        ]
        candidates += sorted(own, key=lambda order: soak_seconds(order, station, shortest_s))[:MANY]
    return sorted(candidates, key=lambda order: soak_seconds(order, station, shortest_s))


def ramp_orders(levels: Sequence[float]) -> list[tuple[float, ...]]:
    """The ends of a ramp in turn, °C: the chamber climbs and falls between the ends of the required temperatures."""
    low, high = min(levels), max(levels)
    if low == high:
        return [(low,)]
    turns = [[(high, low)[(first + k) % 2] for k in range(RAMPS[-1])] for first in (0, 1)]
    return [tuple(turn[:count]) for count in RAMPS for turn in turns]


def mirrored(order: Sequence[float]) -> tuple[float, ...]:
    """The order with its temperatures mirrored about the middle of their range."""
    middle = min(order) + max(order)
    return tuple(round(middle - t, 3) + 0.0 for t in order)


def _returns(order: Sequence[float]) -> bool:
    """Whether a temperature is repeated, and the temperature both rises and falls."""
    rises = [b > a for a, b in pairwise(order)]
    return len(set(order)) < len(order) and any(rises) and not all(rises)


def soak_seconds(order: Sequence[float], station: StationConfig, shortest_s: float) -> float:
    """Station time of the soaks alone, s, from room temperature; each starts from the settled temperature of the one before."""
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    return sum(soaked(StationPose(air=a, device=a), b, station, shortest_s)[0] for a, b in pairwise((room, *order)))
