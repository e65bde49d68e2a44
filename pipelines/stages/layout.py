"""Designs of a recipe laid out in time: when each dwell would be taken, what it would show, and how long all takes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from inertial import design
from inertial.exchange import Slots
from inertial.frames import force_from_angles
from inertial.noise.dwells import dwell_covariance
from inertial.noise.flicker import flicker_of_means
from inertial.state import State
from pipelines.stages.minutes import Standing, move_seconds, soaked
from pipelines.stages.verification import numbered, turns
from schemas.recipe import FEWEST_SAMPLES
from schemas.units import STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from inertial.noise.dwells import DwellNoise
    from pipelines.stages.wish import Wish
    from schemas.recipe import Recipe
    from schemas.station import StationConfig

    Array = NDArray[np.float64]
    Choice = NDArray[np.intp]

SHORTEST_DWELL_S = 1.0
LONGEST_DWELLS = 3.0
"""Longest dwell over the recipe's own."""

_GRAIN_S, _LONG_S = 2.0, 600.0
"""Steps of time in which the covariance of flicker is tabulated, and in which its length grows."""


@dataclass(frozen=True)
class Design:
    """Soaks in order, in °C, how many dwells each has, and how long a dwell is."""

    order: tuple[float, ...]
    counts: tuple[int, ...]
    dwell_s: float

    @property
    def group(self) -> Choice:
        """Number of the soak of every dwell, (n,)."""
        return np.repeat(np.arange(len(self.order)), self.counts)

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Dwells that begin or end a soak: they are taken in the reference pose, (n,)."""
        change = np.diff(self.group) != 0
        return np.concatenate([[True], change]) | np.concatenate([change, [True]])


class Layout:
    """Designs for one recipe, station, noise and wish."""

    def __init__(
        self, recipe: Recipe, station: StationConfig, noise: DwellNoise, wish: Wish, *, slowest: float
    ) -> None:
        self.recipe, self.station, self.noise, self.wish, self.slowest = recipe, station, noise, wish, slowest
        places = numbered("p", wish.candidates)
        standing = [Standing(outer=p.outer_deg, inner=p.inner_deg) for p in places]
        self.travel = np.array([[move_seconds(a, b, station) for b in places] for a in standing])
        self.force = force_from_angles(*np.radians(wish.candidates).T)
        self._reference = int(np.argmax(np.min(np.abs(self.force), axis=1)))  # its least component is largest
        self._spread = spread(self.force)
        self._sensor, _ = design.split(wish.effects or tuple(recipe.effects))
        self._verification = len({(p.outer_deg, p.inner_deg) for p in recipe.verification})

    def dwells(self) -> tuple[float, ...]:
        """Lengths of a dwell that are worth a try, s: the one that brings most for its time, and longer ones.

        Where the slow wander rules, time and not number of dwells is what counts, and longer ones make fewer records.
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

    def start(self, made: Design) -> Choice:
        """A plain design (n,): poses far from one another in turn."""
        choice = self._spread[np.cumsum(~made.fixed) % len(self._spread)]
        choice[made.fixed] = self._reference
        return choice.astype(np.intp)

    def shortfall(self, made: Design) -> tuple[Array, float]:
        """What a plain design lacks of the wish (above one), and its station time in s."""
        choice = self.start(made)
        time, seconds = self._times(made, choice)
        rows = self._columns(time, np.asarray(made.order)[made.group], self.force[choice], choice)
        flat = np.moveaxis(rows, 0, 1).reshape(time.size, -1)
        solved = np.linalg.solve(self.covariance(time, made.dwell_s), flat)
        n, width = time.size, rows.shape[-1]
        left, right = (np.moveaxis(x.reshape(n, 3, width), 1, 0) for x in (flat, solved))
        return self.wish.shortfall(np.swapaxes(left, -1, -2) @ right), seconds

    def alike(self) -> NDArray[np.bool_]:
        """Columns (3, p) that no pose changes: bias, and what it does over temperature and time."""
        every = np.arange(len(self.force))
        rows = self._columns(np.full(every.size, 1000.0), np.full(every.size, max(self.wish.levels)), self.force, every)
        return np.ptp(rows, axis=1) <= 1e-9 * np.max(np.abs(rows), axis=1)

    def slots(self, made: Design) -> tuple[Slots, Choice]:
        """Every candidate in every slot, and a plain design."""
        choice = self.start(made)
        time, seconds = self._times(made, choice)
        n, c = time.size, len(self.force)
        every = np.tile(np.arange(c), n)
        heat = np.repeat(np.asarray(made.order)[made.group], c)
        rows = self._columns(np.repeat(time, c), heat, self.force[every], every).reshape(3, n, c, -1)
        weight = np.asarray(np.linalg.inv(self.covariance(time, made.dwell_s)), dtype=np.float64)
        still = seconds - float(np.sum(self.travel[choice[:-1], choice[1:]]))
        return Slots(np.moveaxis(rows, 0, 2), weight, self.travel, still, made.group, made.fixed), choice

    def covariance(self, time: Array, dwell_s: float) -> Array:
        """Covariance (n, n) of dwell means, g²: as :func:`dwell_covariance`, with the flicker from a table."""
        found = dwell_covariance(time, dwell_s, replace(self.noise, instability=0.0))
        if self.noise.instability > 0.0:
            longest = max(self.slowest, _LONG_S * math.ceil(float(time.max()) / _LONG_S))
            grid, values, own = _flicker(dwell_s, self.slowest if time.max() <= self.slowest else longest)
            gap = np.abs(time[:, None] - time)
            flicker = np.interp(gap, grid, values)
            np.fill_diagonal(flicker, own)
            found += self.noise.instability**2 * flicker
        return found

    def _times(self, made: Design, choice: Choice) -> tuple[Array, float]:
        """Middle of every dwell, and the end of all, s."""
        recipe, order = self.recipe, made.order
        typical = float(np.median(self.travel))
        beside = recipe.settle_s + self.station.pace.record_s + made.dwell_s
        moves = np.concatenate([[typical], self.travel[choice[:-1], choice[1:]]])
        each = moves + beside
        first = np.concatenate([[0], np.cumsum(made.counts)[:-1]])
        each[first] += soak_waits(order, self.station, recipe.soak_min_s)
        verified = [len(turns(self._verification, self.wish.verification, k, len(order))) for k in range(len(order))]
        checks = np.array(verified, dtype=np.float64) * (typical + beside)
        each[first[1:]] += checks[:-1]
        end = np.cumsum(each)
        return end - 0.5 * made.dwell_s, float(end[-1] + checks[-1]) + self._static_soak(order[-1])

    def _static_soak(self, last: float) -> float:
        """Seconds of the soak before the static record; none where it is taken at the last temperature, or not at all."""
        at, recipe = self.recipe.static_temperature_C, self.recipe
        if recipe.static_record_s <= 0.0 or at == last:
            return 0.0
        return soaked(Standing(air=last, device=last), at, self.station, recipe.soak_min_s)[0]

    def _columns(self, time: Array, heat: Array, force: Array, choice: Choice) -> Array:
        """Design columns (3, n, p) over those wanted."""
        angles = np.radians(self.wish.candidates[choice])
        gravity = self.recipe.local_gravity_m_s2 / STANDARD_GRAVITY_M_S2
        state = State(
            force=gravity * force,
            time=time,
            temperature=heat,
            chamber=heat,
            since_power=time,
            since_move=np.full(time.size, self.recipe.settle_s),
            outer=angles[:, 0],
            inner=angles[:, 1],
        )
        columns = design.local_columns(self._sensor, state, design.starting_values(self._sensor, state))
        return columns * self.wish.wanted[:, None, :]


def soak_waits(order: Sequence[float], station: StationConfig, shortest_s: float) -> list[float]:
    """Station time of each soak, s, from the room on."""
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    now, found = Standing(air=room, device=room), list[float]()
    for temperature in order:
        waited, now = soaked(now, temperature, station, shortest_s)
        found.append(waited)
    return found


def spread(force: Array) -> Choice:
    """Candidates (c,) in an order in which each lies far from those before it, opposite poses one after the other."""
    chosen = [0]
    while len(chosen) < len(force):
        last = force[chosen[-1]]
        near = np.max(np.abs(force @ force[chosen[::2]].T), axis=1) if len(chosen) % 2 == 0 else force @ last
        near[chosen] = np.inf
        chosen.append(int(np.argmin(near)))
    return np.array(chosen, dtype=np.intp)


def spanned(force: Array, choice: Choice, fixed: NDArray[np.bool_], needed_g: float) -> Choice:
    """A plan (n,) of candidates that reaches as far on every axis as a recipe must, with as few poses replaced as that takes.

    Parameters
    ----------
    force : (c, 3), of the candidates
    fixed : (n,), slots that stay as they are
    needed_g : largest minus smallest component
    """
    found, free = choice.copy(), ~fixed
    for axis in np.flatnonzero(np.ptp(force[choice], axis=0) < needed_g):
        for far in (int(np.argmax(force[:, axis])), int(np.argmin(force[:, axis]))):
            nearest = np.argmax(np.where(free, force[found] @ force[far], -np.inf))
            if free.any():
                found[nearest], free[nearest] = far, False
    return found


@lru_cache(maxsize=32)
def _flicker(dwell_s: float, longest: float) -> tuple[Array, Array, float]:
    """Covariance of flicker with B = 1 over the time between dwells, and the variance of one dwell."""
    grid = np.concatenate(
        [np.arange(0.5 * dwell_s + 1e-6, 200.0, 0.25), np.arange(200.0, longest + _GRAIN_S, _GRAIN_S)]
    )
    return grid, flicker_of_means(grid, dwell_s, longest), float(flicker_of_means(np.zeros(1), dwell_s, longest)[0])
