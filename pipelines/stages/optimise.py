"""The cheapest recipe that determines a model as well as is wanted: soaks, poses, their order, and the length of dwells."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from inertial import design, poses
from inertial.exchange import Slots, exchanged, ratios
from inertial.frames import force_from_angles
from inertial.noise.dwells import dwell_covariance
from inertial.planning import sights
from inertial.state import State
from pipelines.planned import planned_state
from pipelines.stages.minutes import Standing, move_seconds, soaked, spent
from pipelines.stages.plan import identified, planned
from pipelines.stages.soak_orders import orders, soak_seconds
from schemas.errors import RecipeInvalid
from schemas.recipe import FEWEST_SAMPLES, Pose, SoakPart
from schemas.units import STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from inertial.exchange import Criterion
    from inertial.expected import Expected
    from pipelines.stages.plan import Planned
    from schemas.recipe import Recipe
    from schemas.station import StationConfig

    Array = NDArray[np.float64]
    Progress = Callable[[str], None]

TEXTBOOK_LEVELS = 5
CANDIDATES = 26
WHOLE_DEG = 5.0
SHORTEST_DWELL_S = 1.0
PER_SOAK = (6, 64)
TRIED = 4
ROUGH = 1.3
"""Errors over those wanted that a plain design may have and an exchange of poses still mend."""

LONGEST_DWELLS = 3.0
"""Longest dwell over the recipe's own."""

PART_SEEN = 0.05


@dataclass(frozen=True)
class Wish:
    """What a recipe is wanted to do.

    wanted : (3, p), g per unit of the column, largest error of each coefficient of the model
    see : effects that must be seen beside the model
    levels : °C, temperatures that it must meet
    candidates : angles (c, 2) in degrees that its poses are chosen from
    criterion : see :mod:`inertial.exchange`
    verification : how often each pose for verification is measured in the whole run, spread over the soaks
    """

    wanted: Array
    see: tuple[str, ...]
    levels: tuple[float, ...]
    candidates: Array
    criterion: Criterion = "worst"
    verification: int = 1


@dataclass(frozen=True)
class Optimum:
    """The recipe found, what it takes and expects, and the one that it is held against."""

    planned: Planned
    expected: Expected
    against: Planned
    wanted: Array

    @property
    def worst(self) -> float:
        """Largest error of a coefficient over that wanted."""
        return float(np.max(self.expected.errors / self.wanted))

    @property
    def share(self) -> float:
        """Station time over that of the recipe that it is held against, without the static record."""
        own, other = spent(self.planned.stretches), spent(self.against.stretches)
        return (own.total - own.static_record) / (other.total - other.static_record)


def textbook(recipe: Recipe, levels: Sequence[float]) -> Recipe:
    """The textbook plan over a range: 24 orthogonal poses at nine soaks up and down, 15 min soak, 10 s dwells; the same model."""
    up = np.linspace(min(levels), max(levels), TEXTBOOK_LEVELS)
    heat = _up_and_down(up.tolist() if up[0] < up[-1] else [float(up[0])])
    return recipe.model_copy(
        update={
            "name": "textbook",
            "poses": _poses(poses.plan("orthogonal24")),
            "verification": [],
            "temperatures_C": heat,
            "soaks": [],
            "soak_min_s": 900.0,
            "settle_s": 2.0,
            "dwell_s": 10.0,
        }
    )


def _up_and_down(levels: Sequence[float]) -> list[float]:
    return [*levels, *levels[-2::-1]]


def candidates(station: StationConfig, plan: str = "") -> Array:
    """Angles (c, 2) in degrees of poses to choose from: directions spread over the sphere, both ways of turning there.

    A named plan takes their place where one is given. Faces alone would serve a straight line as well; directions between
    them show the rest of the physics for nothing.
    """
    angles = poses.plan(plan) if plan else WHOLE_DEG * np.round(poses.fibonacci(CANDIDATES) / WHOLE_DEG)
    other = np.stack([-angles[:, 0], np.where(angles[:, 1] > 0.0, angles[:, 1] - 180.0, angles[:, 1] + 180.0)], axis=1)
    both = np.unique(np.concatenate([angles, other]) + 0.0, axis=0)
    outer, inner = station.limits.outer_deg, station.limits.inner_deg
    legal = (both[:, 0] >= outer[0]) & (both[:, 0] <= outer[1]) & (both[:, 1] >= inner[0]) & (both[:, 1] <= inner[1])
    return both[legal]


def optimise(recipe: Recipe, against: Planned, wish: Wish, progress: Progress) -> Optimum:
    """The cheapest recipe that was found to fulfil a wish.

    Orders of soaks are ranked by the station time that a plain design needs in them; in the best, poses are exchanged
    (:mod:`inertial.exchange`), and the fewest per soak that fulfil the wish are kept.

    Raises
    ------
    RecipeInvalid
        No recipe that was tried fulfils it; the message says how near the best comes.
    """
    search = _Search(recipe, against, wish)
    ranked = search.ranked()
    best: Optimum | None = None
    for number, rough in enumerate(ranked[:TRIED], start=1):
        soaks = ", ".join(f"{t:g}" for t in rough.order)
        progress(f"soaks at {soaks} °C ({number} of {min(TRIED, len(ranked))})")
        found = search.fewest(rough, math.inf if best is None else spent(best.planned.stretches).total)
        if found is not None:
            best = Optimum(found, identified(found), against, wish.wanted)
    if best is None:
        blind = f" and does not see {', '.join(search.unseen)}" if search.unseen else ""
        message = (
            f"plan optimise: no recipe of up to {PER_SOAK[1]} poses per soak reaches the errors wanted; the nearest has "
            f"{search.nearest:.3f} times those{blind}; allow larger errors (--factor), or more or other temperatures"
        )
        raise RecipeInvalid(message)
    return best


@dataclass(frozen=True)
class _Rough:
    """An order of soaks with the poses per soak and the station time in s at which a plain design comes near a wish."""

    order: tuple[float, ...]
    per_soak: int
    seconds: float


class _Search:
    """Designs for one recipe, station and wish."""

    def __init__(self, recipe: Recipe, against: Planned, wish: Wish) -> None:
        self.recipe, self.station, self.noise, self.wish = recipe, against.station, against.noise, wish
        self.nearest = math.inf
        self.unseen: list[str] = []
        self.slowest = float(against.state.time[-1])
        self.poses = _poses(wish.candidates)
        here = [Standing(outer=p.outer_deg, inner=p.inner_deg) for p in self.poses]
        self.travel = np.array([[move_seconds(a, b, self.station) for b in self.poses] for a in here])
        self.dwell_s = self.best_dwell()
        self.reference = self._reference()

    def best_dwell(self) -> float:
        """Dwell in whole seconds that brings most for its time and that of its move: longer ones only gather flicker."""
        recipe = self.recipe
        beside = float(np.quantile(self.travel[self.travel > 0.0], 0.1)) + recipe.settle_s
        least = math.ceil(max(SHORTEST_DWELL_S, FEWEST_SAMPLES / recipe.rate_hz))
        lengths = np.arange(least, max(least, round(LONGEST_DWELLS * recipe.dwell_s)) + 1.0)
        cost: list[float] = []
        for length in lengths:
            pair = dwell_covariance(self.slowest + np.array([0.0, length + beside]), length, self.noise)
            cost.append((pair[0, 0] - pair[0, 1]) * (length + beside))
        return float(lengths[int(np.argmin(cost))])

    def _reference(self) -> int:
        """The candidate that begins and ends every soak: the one whose least component is largest."""
        force = force_from_angles(*np.radians(self.wish.candidates).T)
        return int(np.argmax(np.min(np.abs(force), axis=1)))

    def ranked(self) -> list[_Rough]:
        """Orders of soaks in which a plain design comes near the wish, the quickest first."""
        found: list[_Rough] = []
        for order in orders(self.wish.levels, self.station, self.recipe.soak_min_s):
            if found and soak_seconds(order, self.station, self.recipe.soak_min_s) > min(f.seconds for f in found):
                break
            per_soak = _least(lambda count, order=order: self._near(order, count), *PER_SOAK)
            if per_soak is not None:
                found.append(
                    _Rough(order, per_soak, self.slots(order, per_soak)[0].duration(self.slots(order, per_soak)[1]))
                )
        return sorted(found, key=lambda one: one.seconds)

    def _near(self, order: Sequence[float], per_soak: int) -> bool:
        """Whether a plain design has errors that an exchange may bring to those wanted.

        Columns that no pose changes (bias, temperature) are not mended by other poses.
        """
        slots, start = self.slots(order, per_soak)
        found = ratios(slots.matrix(start))
        alike = np.all(np.ptp(slots.rows, axis=1) < 1e-9 * np.max(np.abs(slots.rows), axis=1), axis=0)
        return bool(np.all(found <= np.where(alike, 1.0, ROUGH)))

    def fewest(self, rough: _Rough, limit: float) -> Planned | None:
        """The recipe of the fewest poses per soak that fulfils the wish in an order of soaks, quicker than ``limit`` minutes.

        Errors fall as the root of the number of poses, or slower: that is where the next number comes from.
        """
        best: Planned | None = None
        low, high, count = PER_SOAK[0] - 1, PER_SOAK[1] + 1, rough.per_soak
        while low < count < high:
            found = self.designed(rough.order, count)
            worst = float(np.max(identified(found).errors / self.wish.wanted))
            self.nearest = min(self.nearest, worst)
            slow = spent(found.stretches).total >= limit
            if worst <= 1.0 or slow:
                high = count
                self.unseen = [] if slow or worst > 1.0 else self.blind(found)
                best = best if slow or self.unseen else found
            else:
                low = count
            if high - low <= 1 + high // 25:
                break
            count = min(high - 1, max(low + 1, math.ceil(count * worst**2)))
        return best

    def slots(self, order: Sequence[float], per_soak: int) -> tuple[Slots, NDArray[np.intp]]:
        """Slots of a plan with so many poses at every soak, and a plain design: poses far from one another in turn."""
        time, heat, group = self._times(order, per_soak)
        n, c = time.size, len(self.poses)
        rows = self._rows(time, heat).reshape(3, n, c, -1)
        rows = np.moveaxis(rows, 0, 2) * self.wish.wanted
        covariance = dwell_covariance(time, self.dwell_s, self.noise, slowest=self.slowest)
        fixed = np.zeros(n, dtype=bool)
        place = np.arange(n) % per_soak
        fixed[(place == 0) | (place == per_soak - 1)] = True
        spread = self._spread()
        choice = spread[np.cumsum(~fixed) % len(spread)]
        choice[fixed] = self.reference
        soaking = soak_seconds(order, self.station, self.recipe.soak_min_s)
        seconds = soaking + n * (self.dwell_s + self.recipe.settle_s)
        slots = Slots(rows, np.asarray(np.linalg.inv(covariance), dtype=np.float64), self.travel, seconds, group, fixed)
        return slots, choice.astype(np.intp)

    def _spread(self) -> NDArray[np.intp]:
        """Candidates in an order in which each lies far from those before it, opposite poses one after the other."""
        force = force_from_angles(*np.radians(self.wish.candidates).T)
        chosen = [0]
        while len(chosen) < len(force):
            last = force[chosen[-1]]
            near = np.max(np.abs(force @ force[chosen[::2]].T), axis=1) if len(chosen) % 2 == 0 else force @ last
            near[chosen] = np.inf
            chosen.append(int(np.argmin(near)))
        return np.array(chosen, dtype=np.intp)

    def _times(self, order: Sequence[float], per_soak: int) -> tuple[Array, Array, NDArray[np.intp]]:
        """Middle of every dwell in s with moves of typical length, its temperature, and its soak."""
        each = float(np.median(self.travel)) + self.recipe.settle_s + self.dwell_s
        room = self.station.simulation.room_C if self.station.simulation else self.station.pace.room_C
        now, clock, times = Standing(air=room, device=room), 0.0, []
        for temperature in order:
            waited, now = soaked(now, temperature, self.station, self.recipe.soak_min_s)
            times.append(clock + waited + each * (np.arange(per_soak) + 1.0) - 0.5 * self.dwell_s)
            clock += waited + each * per_soak
        group = np.repeat(np.arange(len(order)), per_soak)
        return np.concatenate(times), np.repeat(np.asarray(order), per_soak), group

    def _rows(self, time: Array, heat: Array) -> Array:
        """Design columns (3, n·c, p) of every candidate at every slot."""
        count = len(self.poses)
        angles = np.radians(np.tile(self.wish.candidates, (time.size, 1)))
        gravity = self.recipe.local_gravity_m_s2 / STANDARD_GRAVITY_M_S2
        at = np.repeat(time, count)
        state = State(
            force=gravity * force_from_angles(angles[:, 0], angles[:, 1]),
            time=at,
            temperature=np.repeat(heat, count),
            chamber=np.repeat(heat, count),
            since_power=at,
            since_move=np.full(at.size, self.recipe.settle_s),
            outer=angles[:, 0],
            inner=angles[:, 1],
        )
        sensor, _ = design.split(self.recipe.effects)
        return design.local_columns(sensor, state, design.starting_values(sensor, state))

    def designed(self, order: Sequence[float], per_soak: int) -> Planned:
        """The recipe with poses exchanged, as the station will go through it."""
        slots, start = self.slots(order, per_soak)
        choice = exchanged(slots, start, self.wish.criterion)
        return planned(
            self._recipe(order, choice.reshape(len(order), per_soak)), self.station, self.noise, slowest=self.slowest
        )

    def _recipe(self, order: Sequence[float], choice: NDArray[np.intp]) -> Recipe:
        used = np.unique(choice)
        number = {int(c): k for k, c in enumerate(used, start=1)}
        chosen = self.wish.candidates[used]
        verification = apart(chosen, self.recipe.verification)
        soaks = [
            SoakPart(
                temperature_C=t,
                poses=[number[int(c)] for c in row],
                verification=_turns(len(verification), self.wish.verification, soak, len(order)),
            )
            for soak, (t, row) in enumerate(zip(order, choice, strict=True))
        ]
        return self.recipe.model_copy(
            update={
                "name": f"{self.recipe.name}-optimal",
                "description": f"{len(chosen)} poses at {len(order)} soaks, as 'tumbleline plan optimise' found them",
                "poses": _poses(chosen),
                "verification": verification,
                "temperatures_C": [float(t) for t in order],
                "soaks": soaks,
                "dwell_s": self.dwell_s,
            }
        )

    def blind(self, found: Planned) -> list[str]:
        """Effects that must be seen and are not."""
        seen = {s.effect: s.left for s in sights(found.state, self.recipe.effects, 1.0, self.wish.see)}
        return [name for name in self.wish.see if seen.get(name, 1.0) < PART_SEEN]


def _turns(count: int, repeats: int, soak: int, soaks: int) -> list[int]:
    """Numbers, from 1, of the poses for verification that are measured at a soak: each goes on from soak to soak."""
    return [k for turn in range(repeats) for k in range(1, count + 1) if (k + turn) % soaks == soak]


def verified_in(recipe: Recipe) -> int:
    """How often a recipe measures each of its poses for verification in the whole run, rounded up."""
    taken = [(p.outer_deg, p.inner_deg) for k in range(len(recipe.temperatures_C)) for p in recipe.verification_at(k)]
    return -(-len(taken) // len(set(taken))) if taken else 1


def _least(good: Callable[[int], bool], low: int, high: int) -> int | None:
    """The least number from low to high that is good, where all above a good one are; None where none is."""
    if not good(high):
        return None
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if good(middle) else (middle + 1, high)
    return high


def apart(chosen: Array, given: Sequence[Pose]) -> list[Pose]:
    """As many poses for verification as are given, farthest from the fit's poses and from one another."""
    count = len({(p.outer_deg, p.inner_deg) for p in given})
    grid = WHOLE_DEG * np.round(poses.fibonacci(400) / WHOLE_DEG)
    force, taken = force_from_angles(*np.radians(grid).T), force_from_angles(*np.radians(chosen).T)
    found: list[Array] = []
    for _ in range(count):
        near = np.max(force @ taken.T, axis=1)
        best = int(np.argmin(near))
        found.append(grid[best])
        taken = np.concatenate([taken, force[best : best + 1]])
    return [Pose(name=f"v{k}", outer_deg=float(o), inner_deg=float(i)) for k, (o, i) in enumerate(found, start=1)]


def _poses(angles: Array) -> list[Pose]:
    width = len(str(len(angles)))
    return [
        Pose(name=f"p{k:0{width}d}", outer_deg=float(outer), inner_deg=float(inner))
        for k, (outer, inner) in enumerate(angles, start=1)
    ]


def seen_by(against: Planned, levels: Sequence[float]) -> tuple[str, ...]:
    """Effects that the textbook plan sees beside its model, as far as these temperatures allow it, ageing and hysteresis too."""
    there = against.recipe.model_copy(update={"temperatures_C": _up_and_down(sorted(levels))})
    states = (against.state, planned_state(there, against.station, history=True))
    seen = [{s.effect for s in sights(state, there.effects, 1.0) if s.left >= 2.0 * PART_SEEN} for state in states]
    return tuple(sorted(seen[0] & seen[1]))
