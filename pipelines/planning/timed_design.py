"""Plan designs with times: time and columns of every dwell, covariance of the means, station time, and the fewest dwells."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from inertial import design, timing
from inertial.arrays import Array, Flags
from inertial.frames import force_from_angles
from inertial.noise.dwells import DwellNoise, dwell_covariance
from inertial.noise.flicker import flicker_of_means
from inertial.planning.pose_exchange import PlanSlots
from pipelines.planning.requirement import Requirement, numbered, turns
from pipelines.schedule.planned_state import settled_state
from pipelines.schedule.timing import StationPose, air_of, move_seconds, soaked
from schemas.recipe import FEWEST_SAMPLES, Recipe
from schemas.station import StationConfig
from schemas.units import STANDARD_GRAVITY_M_S2

Choice = NDArray[np.intp]

SHORTEST_DWELL_S = 1.0
LONGEST_DWELLS = 3.0  # longest dwell to try, as a multiple of the recipe's dwell
_GRAIN_S, _LONG_S = 2.0, 600.0  # step of the table of flicker covariance, and the increment of its length, s
FEWEST = 4  # minimum number of dwells of a soak: the reference pose at both ends, and two other poses between
MOST = 420  # maximum number of dwells of a recipe: above it the search time grows faster than the gain
REACHED = 0.04  # distance from the ends of the required temperatures that a ramp may leave, in parts of their range
_FIRST = 3  # the first reduction removes one part in this many of a soak's dwells


@dataclass(frozen=True)
class PlanDesign:
    """Soak temperatures in order, °C; the number of dwells at each; the length of a dwell, s.

    In a ``ramp`` nothing soaks: the chamber is on its way to each temperature in turn while the table goes on through poses.
    """

    order: tuple[float, ...]
    counts: tuple[int, ...]
    dwell_s: float
    ramp: bool = False

    @property
    def group(self) -> Choice:
        """Number of the soak of every dwell, (n,)."""
        return np.repeat(np.arange(len(self.order)), self.counts)

    @property
    def fixed(self) -> Flags:
        """Dwells that begin or end a soak, (n,): they use the reference pose."""
        change = np.diff(self.group) != 0
        return np.concatenate([[True], change]) | np.concatenate([change, [True]])


class TimedDesign:
    """Times, columns and covariance of plan designs for one recipe, station, noise and requirement.

    slowest : s, longest time over which flicker is modelled
    """

    def __init__(
        self, recipe: Recipe, station: StationConfig, noise: DwellNoise, requirement: Requirement, *, slowest: float
    ) -> None:
        self.recipe, self.station, self.noise = recipe, station, noise
        self.requirement, self.slowest = requirement, slowest
        poses = numbered("p", requirement.candidates)
        starts = [StationPose(outer=p.outer_deg, inner=p.inner_deg) for p in poses]
        self.travel = np.array([[move_seconds(a, b, station) for b in poses] for a in starts])
        self.force = force_from_angles(*np.radians(requirement.candidates).T)
        # the pose whose smallest component is largest
        self._reference = int(np.argmax(np.min(np.abs(self.force), axis=1)))
        self._spread = spread(self.force)
        self._axes = tuple(range(recipe.sensor_axes))
        self._sensor, _ = design.split(requirement.effects or tuple(recipe.effects))
        self._verification = len({(p.outer_deg, p.inner_deg) for p in recipe.verification})

    def dwell_lengths(self) -> tuple[float, ...]:
        """Lengths of a dwell to try, s: the length with most information per time, and three and nine times that.

        Where slow wander dominates, the total time counts and not the number of dwells; longer dwells then need fewer records.
        """
        least = math.ceil(max(SHORTEST_DWELL_S, FEWEST_SAMPLES / self.recipe.rate_hz))
        most = max(float(least), LONGEST_DWELLS * self.recipe.dwell_s)
        lengths = np.arange(least, most + 1.0)
        beside = float(np.quantile(self.travel[self.travel > 0.0], 0.1)) + self.recipe.settle_s
        cost: list[float] = []
        for length in lengths:
            pair = dwell_covariance(self.slowest + np.array([0.0, length + beside]), length, self.noise)
            cost.append((pair[0, 0] - pair[0, 1]) * (length + beside))
        best = float(lengths[int(np.argmin(cost))])
        return tuple(x for x in (best, 3.0 * best, 9.0 * best) if x <= most)

    def start(self, plan: PlanDesign) -> Choice:
        """Starting arrangement (n,): candidates in an order of large distances."""
        choice = self._spread[np.cumsum(~plan.fixed) % len(self._spread)]
        choice[plan.fixed] = self._reference
        return choice.astype(np.intp)

    def ratio_and_seconds(self, plan: PlanDesign) -> tuple[Array, float]:
        """Ratios to the requirement (met at ≤ 1) of a design's starting arrangement, and its station time in s."""
        choice = self.start(plan)
        time, heat, seconds = self._times(plan, choice)
        rows = self._columns(time, heat, choice)
        ratio = self.requirement.ratio_to_required(normal_matrix(rows, self.covariance(time, plan.dwell_s)))
        return self.within(ratio, heat) if plan.ramp else ratio, seconds

    def within(self, ratio: Array, heat: Array) -> Array:
        """Ratios to the requirement that are met only where a ramp (n,), °C, gets to the ends of the range, however small."""
        missed = short_of(heat, self.requirement.levels)
        return np.maximum(ratio, 1.0 + missed) if missed > 0.0 else ratio

    def pose_independent(self) -> Flags:
        """Columns (axes, p) that do not depend on the pose: bias and its dependence on temperature and time."""
        every = np.arange(len(self.force))
        rows = self._columns(np.full(every.size, 1000.0), np.full(every.size, max(self.requirement.levels)), every)
        return np.ptp(rows, axis=1) <= 1e-9 * np.max(np.abs(rows), axis=1)

    def slots(self, plan: PlanDesign) -> tuple[PlanSlots, Choice]:
        """Every candidate in every slot of a design, and its starting arrangement."""
        choice = self.start(plan)
        time, heat, seconds = self._times(plan, choice)
        n, c = time.size, len(self.force)
        every = np.tile(np.arange(c), n)
        rows = self._columns(np.repeat(time, c), np.repeat(heat, c), every).reshape(len(self._axes), n, c, -1)
        weight = np.asarray(np.linalg.inv(self.covariance(time, plan.dwell_s)), dtype=np.float64)
        without_travel = seconds - float(np.sum(self.travel[choice[:-1], choice[1:]]))
        return PlanSlots(np.moveaxis(rows, 0, 2), weight, self.travel, without_travel, plan.group, plan.fixed), choice

    def covariance(self, time: Array, dwell_s: float) -> Array:
        """Covariance (n, n) of dwell means, g²: :func:`dwell_covariance` with flicker interpolated from a table."""
        covariance = dwell_covariance(time, dwell_s, replace(self.noise, instability=0.0))
        if self.noise.instability > 0.0:
            longest = max(self.slowest, _LONG_S * math.ceil(float(time.max()) / _LONG_S))
            grid, values, variance = _flicker(dwell_s, self.slowest if time.max() <= self.slowest else longest)
            gap = np.abs(time[:, None] - time)
            flicker = np.interp(gap, grid, values)
            np.fill_diagonal(flicker, variance)
            covariance += self.noise.instability**2 * flicker
        return covariance

    def _times(self, plan: PlanDesign, choice: Choice) -> tuple[Array, Array, float]:
        """Middle of every dwell, s, the device's temperature there, °C, and the end of the last, s."""
        recipe, order = self.recipe, plan.order
        typical = float(np.median(self.travel))
        beside = recipe.settle_s + self.station.pace.record_s + plan.dwell_s
        moves = np.concatenate([[typical], self.travel[choice[:-1], choice[1:]]])
        each = moves + beside
        first = np.concatenate([[0], np.cumsum(plan.counts)[:-1]])
        each[first] += 0.0 if plan.ramp else soak_waits(order, self.station, recipe.soak_min_s)
        verified = [
            len(turns(self._verification, self.requirement.verification, k, len(order))) for k in range(len(order))
        ]
        checks = np.array(verified, dtype=np.float64) * (typical + beside)
        if plan.ramp:  # spread among the others
            each += np.repeat(checks / np.asarray(plan.counts), plan.counts)
        else:
            each[first[1:]] += checks[:-1]
        end = np.cumsum(each)
        heat = self._followed(plan, end) if plan.ramp else np.asarray(order)[plan.group]
        last = float(end[-1]) if plan.ramp else float(end[-1] + checks[-1])
        return end - 0.5 * plan.dwell_s, heat, last + self._static_soak(order[-1])

    def _followed(self, plan: PlanDesign, end: Array) -> Array:
        """The device's temperature (n,) at the middle of the dwells of a ramp that end at these times, °C."""
        pace = air_of(self.station)
        room = self.station.simulation.room_C if self.station.simulation else self.station.pace.room_C
        air, device, clock = room, room, 0.0
        heat = np.empty(end.size)
        for k, (stop, leg) in enumerate(zip(end, plan.group, strict=True)):
            target = plan.order[leg]
            air, begun = timing.followed(air, device, target, float(stop) - plan.dwell_s - clock, pace)
            air, device = timing.followed(air, begun, target, plan.dwell_s, pace)
            heat[k], clock = 0.5 * (begun + device), float(stop)
        return heat

    def _static_soak(self, last: float) -> float:
        """Soak before the static record, s; 0 where that is at the last temperature, or is not taken."""
        at, recipe = self.recipe.static_temperature_C, self.recipe
        if recipe.static_record_s <= 0.0 or at == last:
            return 0.0
        return soaked(StationPose(air=last, device=last), at, self.station, recipe.soak_min_s)[0]

    def _columns(self, time: Array, heat: Array, choice: Choice) -> Array:
        """Design columns (axes, n, p) of candidates in units of the required errors."""
        angles = np.radians(self.requirement.candidates[choice])
        force = self.recipe.local_gravity_m_s2 / STANDARD_GRAVITY_M_S2 * self.force[choice]
        state = settled_state(force, time, heat, angles, self.recipe.settle_s, self._axes)
        columns = design.local_columns(self._sensor, state, design.starting_values(self._sensor, state))
        return columns * self.requirement.errors[:, None, :]


def normal_matrix(rows: Array, covariance: Array) -> Array:
    """Normal matrices (axes, p, p) of design rows (axes, n, p); one factorisation of the covariance (n, n) serves all axes."""
    flat = np.moveaxis(rows, 0, 1).reshape(len(covariance), -1)
    both = (flat, np.linalg.solve(covariance, flat))
    left, right = (np.moveaxis(x.reshape(len(covariance), len(rows), -1), 1, 0) for x in both)
    return np.swapaxes(left, -1, -2) @ right


def short_of(heat: Array, levels: Sequence[float]) -> float:
    """Excess of the missed part of the range by a ramp (n,), °C, over the allowed part, relative to that; 0 where none.

    A model is not to be extrapolated: the devices must get within :data:`REACHED` of the range.
    """
    low, high = min(levels), max(levels)
    allowed = REACHED * (high - low)
    missed = max(float(heat.min()) - low, high - float(heat.max()), 0.0)
    return 0.0 if missed <= allowed else missed / allowed - 1.0


def followed_along(targets: Sequence[float], piece_s: float, start: float, station: StationConfig) -> Array:
    """The slowest device's temperature (n,) in the middle of pieces of equal length, each with its set point, °C."""
    pace, air, device = air_of(station), start, start
    heat = np.empty(len(targets))
    for k, target in enumerate(targets):
        before = device
        air, device = timing.followed(air, device, target, piece_s, pace)
        heat[k] = 0.5 * (before + device)
    return heat


def soak_waits(order: Sequence[float], station: StationConfig, shortest_s: float) -> list[float]:
    """Station time of each soak, s, from room temperature."""
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    now, seconds = StationPose(air=room, device=room), list[float]()
    for temperature in order:
        waited, now = soaked(now, temperature, station, shortest_s)
        seconds.append(waited)
    return seconds


def spread(force: Array) -> Choice:
    """Candidates (c,) ordered so that each is far from those before it, opposite poses in pairs."""
    chosen = [0]
    while len(chosen) < len(force):
        last = force[chosen[-1]]
        near = np.max(np.abs(force @ force[chosen[::2]].T), axis=1) if len(chosen) % 2 == 0 else force @ last
        near[chosen] = np.inf
        chosen.append(int(np.argmin(near)))
    return np.array(chosen, dtype=np.intp)


def spanned(force: Array, choice: Choice, fixed: Flags, needed_g: float, axes: int) -> Choice:
    """A plan (n,) of candidates with the required span of specific force on the axes, as few poses as possible replaced.

    force : (c, 3), of the candidates
    fixed : (n,), slots that are not changed
    needed_g : g, required difference of the largest and smallest component
    axes : number of axes with an output: the other components need no span
    """
    changed, free = choice.copy(), ~fixed
    for axis in np.flatnonzero(np.ptp(force[choice], axis=0)[:axes] < needed_g):
        for far in (int(np.argmax(force[:, axis])), int(np.argmin(force[:, axis]))):
            nearest = np.argmax(np.where(free, force[changed] @ force[far], -np.inf))
            if free.any():
                changed[nearest], free[nearest] = far, False
    return changed


@lru_cache(maxsize=32)
def _flicker(dwell_s: float, longest: float) -> tuple[Array, Array, float]:
    """Covariance of dwell means under flicker of B = 1 against the time between them, and the variance of one dwell."""
    grid = np.concatenate(
        [np.arange(0.5 * dwell_s + 1e-6, 200.0, 0.25), np.arange(200.0, longest + _GRAIN_S, _GRAIN_S)]
    )
    return grid, flicker_of_means(grid, dwell_s, longest), float(flicker_of_means(np.zeros(1), dwell_s, longest)[0])


def fewest_dwells(timed: TimedDesign, design: PlanDesign, allowed: Array) -> PlanDesign | None:
    """The design with the fewest dwells whose starting arrangement stays within the allowed ratios; None where there is none.

    design : soaks and dwell length; its counts are replaced
    allowed : (axes, p) or (pairs,), largest ratio to the required errors, as returned by :meth:`TimedDesign.ratio_and_seconds`;
        above 1 where an exchange of poses is expected to improve it
    """

    def worst_ratio(counts: tuple[int, ...]) -> float:
        return float(np.max(timed.ratio_and_seconds(replace(design, counts=counts))[0] / allowed))

    soaks = len(design.order)
    uniform = smallest_passing(lambda n: worst_ratio((n,) * soaks) <= 1.0, FEWEST, MOST // soaks)
    if uniform is None:
        return None
    counts, step = (uniform,) * soaks, max(1, uniform // _FIRST)
    while step >= 1:
        fewer = _fewer(counts, step, worst_ratio)
        counts, step = (counts, step // 2) if fewer is None else (fewer, step)
    return replace(design, counts=counts)


def _fewer(
    counts: tuple[int, ...], step: int, worst_ratio: Callable[[tuple[int, ...]], float]
) -> tuple[int, ...] | None:
    """Counts with a smaller sum that still meet the ratios; None where neither a reduction nor a shift does."""
    for variants in (_reduced(counts, step), _shifted(counts, step)):
        passing = [(ratio, variant) for variant in variants if (ratio := worst_ratio(variant)) <= 1.0]
        if passing:
            return min(passing)[1]
    return None


def _reduced(counts: tuple[int, ...], step: int) -> Iterator[tuple[int, ...]]:
    """Counts with ``step`` dwells removed from one soak."""
    for k, n in enumerate(counts):
        if n - step >= FEWEST:
            yield (*counts[:k], n - step, *counts[k + 1 :])


def _shifted(counts: tuple[int, ...], step: int) -> Iterator[tuple[int, ...]]:
    """Counts with ``2·step`` dwells removed from one soak and ``step`` added to another."""
    for source, target in permutations(range(len(counts)), 2):
        if counts[source] - 2 * step >= FEWEST:
            variant = list(counts)
            variant[source] -= 2 * step
            variant[target] += step
            yield tuple(variant)


def smallest_passing(passes: Callable[[int], bool], low: int, high: int) -> int | None:
    """The smallest number from low to high that passes, by bisection; None where ``high`` fails.

    Every number above a passing number must pass, too.
    """
    if not passes(high):
        return None
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if passes(middle) else (middle + 1, high)
    return high
