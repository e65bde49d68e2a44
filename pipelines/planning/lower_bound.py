"""The least station time that any recipe needs for the coefficients that no pose changes: a bound, not a recipe.

Bias, and what it does over temperature and time, look alike in every pose; their errors are what the device wanders over the run.
So let every minute that is no soak be one dwell that ends never, let the rest of the model be known, and ask how short a run
may be. What no recipe of that length can reach, none with moves, settling and other coefficients will.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from inertial import design
from inertial.noise.dwells import dwell_covariance
from inertial.state import State
from pipelines.planning.layout import soak_waits
from pipelines.planning.soak_orders import orders
from pipelines.schedule.timing import spent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pipelines.planning.plan import PlanContext
    from pipelines.planning.requirement import Requirement
    from schemas.recipe import Recipe

    Array = NDArray[np.float64]

PIECE_S = 120.0
"""Length of the dwells that the time between soaks is filled with."""

LOWEST, STEP = 0.3, 0.01
"""Share of the textbook plan's time from which lengths are tried, and between them."""

LIKELY = 20
"""Orders of soaks whose time is divided at best, of those that come nearest when it is divided equally."""


@dataclass(frozen=True)
class LowerBound:
    """The shortest run: its part of the textbook plan's station time, its soaks in °C, and the effect that asks for most."""

    share: float
    order: tuple[float, ...]
    effect: str


def least(recipe: Recipe, against: PlanContext, wish: Requirement) -> LowerBound | None:
    """The shortest run in which coefficients that no pose changes can be known as well as is wanted.

    None where even a run as long as the textbook plan's is too short, or no coefficient is of that kind.
    """
    bound = _Bound(recipe, against, wish)
    found = orders(wish.levels, against.station, recipe.soak_min_s, legal=wish.legal)
    low, high, best = round(LOWEST / STEP), round(1.0 / STEP), None
    while low <= high and bound.columns.size:
        middle = (low + high) // 2
        reached = bound.reached(found, middle * STEP)
        if reached is None:
            low = middle + 1
        else:
            high, best = middle - 1, LowerBound(middle * STEP, *reached)
    return best


class _Bound:
    """Errors of the coefficients that no pose changes, for soaks in order and the time after each."""

    def __init__(self, recipe: Recipe, against: PlanContext, wish: Requirement) -> None:
        self.recipe, self.against, self.wish = recipe, against, wish
        self.total = 60.0 * (spent(against.stretches).total - spent(against.stretches).static_record)
        self.slowest = float(against.state.time[-1])
        self.sensor, _ = design.split(recipe.effects)
        self.names = [name for name, _ in design.local_names(self.sensor, 0)]
        heat = np.asarray(sorted({*wish.levels, *wish.legal}))
        self.columns = np.flatnonzero(np.any(self._rows(1000.0 * np.arange(1.0, heat.size + 1.0), heat), axis=(0, 1)))

    def reached(self, found: Sequence[tuple[float, ...]], share: float) -> tuple[tuple[float, ...], str] | None:
        """An order of soaks in which the errors wanted are reached in a part of the time, and what is nearest to its limit."""
        rated: list[tuple[float, tuple[float, ...], tuple[int, ...]]] = []
        for order in found:
            pieces = int((share * self.total - sum(self._waits(order))) // PIECE_S)
            counts = tuple(np.diff(np.linspace(0, pieces, len(order) + 1).astype(int)).tolist())
            if min(counts) > 0:
                rated.append((self._worst(order, counts)[0], order, counts))
        for _, order, counts in sorted(rated)[:LIKELY]:
            worst, effect = self._divided(order, counts)
            if worst <= 1.0:
                return order, effect
        return None

    def _divided(self, order: tuple[float, ...], counts: tuple[int, ...]) -> tuple[float, str]:
        """The least error over that wanted, the time divided at best among the soaks."""
        best = self._worst(order, counts)
        step = max(1, sum(counts) // len(counts) // 2)
        while step >= 1 and best[0] > 1.0:
            tried: list[tuple[float, str, tuple[int, ...]]] = []
            for here, there in permutations(range(len(order)), 2):
                new = list(counts)
                new[here] -= step
                new[there] += step
                if new[here] > 0:
                    tried.append((*self._worst(order, tuple(new)), tuple(new)))
            value, effect, moved = min(tried, default=(np.inf, "", counts))
            better = value < best[0] - 1e-5
            best, counts = ((value, effect), moved) if better else (best, counts)
            step = step if better else step // 2
        return best

    def _worst(self, order: tuple[float, ...], counts: tuple[int, ...]) -> tuple[float, str]:
        """The largest error over that wanted, and whose it is."""
        time: list[Array] = []
        heat, clock = np.repeat(np.asarray(order), counts), 0.0
        for waited, count in zip(self._waits(order), counts, strict=True):
            time.append(clock + waited + PIECE_S * np.arange(0.5, count))
            clock += waited + PIECE_S * count
        when = np.concatenate(time)
        rows = self._rows(when, heat)[..., self.columns]
        covariance = dwell_covariance(when, PIECE_S, self.against.noise, slowest=self.slowest)
        flat = np.moveaxis(rows, 0, 1).reshape(when.size, -1)
        solved = np.moveaxis(np.linalg.solve(covariance, flat).reshape(when.size, 3, -1), 1, 0)
        errors = self.wish.shortfall(np.swapaxes(rows, -1, -2) @ solved)
        return float(errors.max()), self.names[self.columns[int(np.argmax(errors.max(axis=0)))]]

    def _rows(self, time: Array, heat: Array) -> Array:
        """Columns (3, n, p) over those wanted, without any force."""
        angle = np.zeros(time.size)
        state = State(
            force=np.zeros((time.size, 3)),
            time=time,
            temperature=heat,
            chamber=heat,
            since_power=time,
            since_move=np.full(time.size, 1e4),
            outer=angle,
            inner=angle,
        )
        columns = design.local_columns(self.sensor, state, design.starting_values(self.sensor, state))
        return columns * self.wish.wanted[:, None, :]

    def _waits(self, order: tuple[float, ...]) -> list[float]:
        return soak_waits(order, self.against.station, self.recipe.soak_min_s)
