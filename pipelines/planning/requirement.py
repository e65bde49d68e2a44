"""The requirement of a recipe search: required errors or discrimination, temperatures with their orders, poses to choose from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np

from inertial import poses
from inertial.arrays import Array, Index
from inertial.frames import force_from_angles
from inertial.planning.discrimination import Discrimination
from inertial.planning.pose_exchange import CRITERIA, Criterion, ratios
from inertial.state import T_REFERENCE
from pipelines.schedule.timing import StationPose, soaked
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.station import StationConfig

WHOLE_DEG = 5.0


def numbered(letter: str, angles: Array) -> list[Pose]:
    """Poses at angles (n, 2) in degrees, named by a letter and a number."""
    width = len(str(len(angles)))
    return [
        Pose(name=f"{letter}{k:0{width}d}", outer_deg=float(outer), inner_deg=float(inner))
        for k, (outer, inner) in enumerate(angles, start=1)
    ]


def apart(chosen: Array, given: Sequence[Pose]) -> list[Pose]:
    """As many verification poses as ``given`` has, each with the largest angle to the fit's poses and to one another."""
    count = len({(p.outer_deg, p.inner_deg) for p in given})
    grid = WHOLE_DEG * np.round(poses.fibonacci(400) / WHOLE_DEG)
    force, used = force_from_angles(*np.radians(grid).T), force_from_angles(*np.radians(chosen).T)
    angles: list[Array] = []
    for _ in range(count):
        near = np.max(force @ used.T, axis=1)
        best = int(np.argmin(near))
        angles.append(grid[best])
        used = np.concatenate([used, force[best : best + 1]])
    return numbered("v", np.array(angles).reshape(-1, 2))


def turns(count: int, repeats: int, soak: int, soaks: int) -> list[int]:
    """Numbers, from 1, of the verification poses measured at a soak; the sequence continues from soak to soak."""
    return [k for turn in range(repeats) for k in range(1, count + 1) if (k + turn) % soaks == soak]


def verified_in(recipe: Recipe) -> int:
    """Repetitions of each verification pose in the whole run, rounded up."""
    taken = [(p.outer_deg, p.inner_deg) for k in range(len(recipe.temperatures_C)) for p in recipe.verification_at(k)]
    return -(-len(taken) // len(set(taken))) if taken else 1


CANDIDATES = 26
QUARTERS = 4


@dataclass(frozen=True)
class Requirement:
    """The errors that a recipe must reach, and the poses, temperatures and orders that it may consist of.

    errors : (axes, p), g per unit of the column, largest standard error of each coefficient; with ``discrimination`` the scale of
        each column
    see : ids of effects that must be visible beside the model
    levels : °C, temperatures that every recipe includes
    candidates : (c, 2), degrees, outer and inner angle of the poses to choose from
    optional_levels : °C, further temperatures that a recipe may include
    criterion : see :mod:`inertial.planning.pose_exchange`
    verification : repetitions of each verification pose in the whole run, distributed over the soaks
    effects : ids of the effects to which the columns of ``errors`` belong; the recipe's model where empty
    discrimination : rivals to discriminate between, instead of required errors
    prior : (axes, p, p), precision of a prior of the coefficients, 1/g²; discrimination does not use it
    """

    errors: Array
    see: tuple[str, ...]
    levels: tuple[float, ...]
    candidates: Array
    optional_levels: tuple[float, ...] = ()
    criterion: Criterion = "worst"
    verification: int = 1
    effects: tuple[str, ...] = ()
    discrimination: Discrimination | None = None
    prior: Array | None = None

    def ratio_to_required(self, matrix: Array, columns: Index | None = None) -> Array:
        """Expected over required errors, (..., axes, p), or per pair, of normal matrices (..., axes, p, p); met at ≤ 1.

        columns : of the coefficients in the matrices, the others being known; all where None
        """
        if self.discrimination is not None:
            return self.discrimination.ratio_to_required(matrix)
        return ratios(matrix + (self._known if columns is None else self._known[:, columns[:, None], columns]))

    @cached_property
    def _known(self) -> Array:
        """Precision (axes, p, p) of the prior in units of the required errors; zero without a prior."""
        axes, p = self.errors.shape
        return (
            np.zeros((axes, p, p))
            if self.prior is None
            else self.prior * self.errors[:, :, None] * self.errors[:, None, :]
        )

    @property
    def objective(self) -> Callable[[Array], Array]:
        """The function of normal matrices that an exchange of poses minimises."""
        if self.discrimination is not None:
            return self.discrimination.objective
        criterion, known = CRITERIA[self.criterion], self._known
        return lambda matrix: criterion(matrix + known)


def candidates(station: StationConfig, plan: str = "", count: int = CANDIDATES) -> Array:
    """Angles (c, 2) in degrees of candidate poses within the station's limits, each direction with both axis settings.

    Directions are those of a Fibonacci lattice of ``count`` points on the sphere, or of a named plan. Faces alone are enough for
    a linear model; directions between them make further effects visible at no extra cost.
    """
    angles = poses.plan(plan) if plan else WHOLE_DEG * np.round(poses.fibonacci(count) / WHOLE_DEG)
    other = np.stack([-angles[:, 0], np.where(angles[:, 1] > 0.0, angles[:, 1] - 180.0, angles[:, 1] + 180.0)], axis=1)
    both = np.unique(np.concatenate([angles, other]) + 0.0, axis=0)
    outer, inner = station.limits.outer_deg, station.limits.inner_deg
    allowed = (both[:, 0] >= outer[0]) & (both[:, 0] <= outer[1]) & (both[:, 1] >= inner[0]) & (both[:, 1] <= inner[1])
    return both[allowed]


def temperature_choices(levels: Sequence[float]) -> tuple[float, ...]:
    """Temperatures, °C, that a recipe may include: those given, quarters of their range, and the reference inside it."""
    low, high = min(levels), max(levels)
    quarters = np.round(np.linspace(low, high, QUARTERS + 1), 1).tolist()
    return tuple(sorted({*levels, *quarters, *([T_REFERENCE] if low < T_REFERENCE < high else [])}))


FEWEST, MOST = 3, 6
MANY = 250  # number of orders of each length to consider, the quickest
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
        of_length = [
            o
            for o in product(free, repeat=count)
            if set(levels) <= set(o) and all(a != b for a, b in pairwise(o)) and (not back or _returns(o))
        ]
        candidates += sorted(of_length, key=lambda order: soak_seconds(order, station, shortest_s))[:MANY]
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
    """Station time of the soaks alone, s, from room temperature; each starts from the settled temperature of the soak before."""
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    return sum(soaked(StationPose(air=a, device=a), b, station, shortest_s)[0] for a, b in pairwise((room, *order)))
