"""Lower bound of the station time for the coefficients that do not depend on the pose.

The bias and its dependence on temperature and time have the same column in every pose; their errors follow from the wander of the
device over the run. The bound assumes uninterrupted measurement between soaks, or along ramps of the chamber, and that all
other coefficients are known. A real recipe also needs moves, settling and the other coefficients, so that its station time cannot
be shorter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from inertial import design
from inertial.arrays import Array
from inertial.noise.dwells import dwell_covariance
from pipelines.planning.context import PlanContext
from pipelines.planning.requirement import Requirement, orders
from pipelines.planning.timed_design import followed_along, normal_matrix, short_of, soak_waits
from pipelines.schedule.planned_state import settled_state
from schemas.recipe import Recipe

RESTED_S = 1e4  # s at rest before a dwell: nothing of the last move is left
PIECE_S = 120.0  # length of the dwells that fill the time between soaks, s
RAMP_PIECE_S = 30.0  # likewise along a ramp, in which the temperature changes
FIRST_LEGS = (0.5, 0.75, 1.0, 1.25)  # times of the first ramp, which begins in the room, over those of the others
LOWEST, STEP = 0.05, 0.01  # smallest share of the textbook plan's station time to try, and the step
LIKELY = 20  # number of orders of soaks whose division of time is optimised, the best orders under equal division


@dataclass(frozen=True)
class LowerBound:
    """The shortest run: share of the textbook plan's station time, soaks in °C, and the effect that determines it."""

    share: float
    order: tuple[float, ...]
    effect: str


def lower_bound(
    recipe: Recipe, against: PlanContext, requirement: Requirement, *, ramp: bool = False
) -> LowerBound | None:
    """The shortest run with soaks, or along ramps, that reaches the required errors of the pose-independent coefficients.

    None where a run as long as the textbook plan is too short, or the model has no pose-independent coefficient.
    """
    search = _BoundSearch(recipe, against, requirement)
    soak_orders = orders(requirement, against.station, recipe.soak_min_s, ramp=ramp)
    low, high, best = round(LOWEST / STEP), round(1.0 / STEP), None
    while low <= high and search.columns.size:
        middle = (low + high) // 2
        reached = (search.on_ramps if ramp else search.reached)(soak_orders, middle * STEP)
        if reached is None:
            low = middle + 1
        else:
            high, best = middle - 1, LowerBound(middle * STEP, *reached)
    return best


class _BoundSearch:
    """Errors of the pose-independent coefficients, for soaks in order and the time after each."""

    def __init__(self, recipe: Recipe, against: PlanContext, requirement: Requirement) -> None:
        self.recipe, self.against, self.requirement = recipe, against, requirement
        self.total = 60.0 * against.minutes
        self.slowest = float(against.state.time[-1])
        self.sensor, _ = design.split(recipe.effects)
        self.names = [name for name, _ in design.local_names(self.sensor, 0)]
        heat = np.asarray(sorted({*requirement.levels, *requirement.optional_levels}))
        self._rated: dict[tuple[tuple[float, ...], tuple[int, ...]], tuple[float, str]] = {}
        self.columns = np.flatnonzero(np.any(self._rows(1000.0 * np.arange(1.0, heat.size + 1.0), heat), axis=(0, 1)))

    def reached(self, soak_orders: Sequence[tuple[float, ...]], share: float) -> tuple[tuple[float, ...], str] | None:
        """An order of soaks that reaches the required errors in a share of the time, and the effect nearest to its limit."""
        rated: list[tuple[float, tuple[float, ...], tuple[int, ...]]] = []
        for order in soak_orders:
            pieces = int((share * self.total - sum(self._waits(order))) // PIECE_S)
            counts = tuple(np.diff(np.linspace(0, pieces, len(order) + 1).astype(int)).tolist())
            if min(counts) > 0:
                rated.append((self._worst(order, counts)[0], order, counts))
        for _, order, counts in sorted(rated)[:LIKELY]:
            worst, effect = self._divided(order, counts)
            if worst <= 1.0:
                return order, effect
        return None

    def on_ramps(self, ramps: Sequence[tuple[float, ...]], share: float) -> tuple[tuple[float, ...], str] | None:
        """Ramps that reach the required errors in a share of the time, and the effect nearest to its limit."""
        station = self.against.station
        room = station.simulation.room_C if station.simulation else station.pace.room_C
        pieces = int(share * self.total // RAMP_PIECE_S)
        when = RAMP_PIECE_S * np.arange(0.5, pieces)
        rated: list[tuple[float, str, tuple[float, ...]]] = []
        for order in ramps:
            for first in FIRST_LEGS:
                ends = np.cumsum([first, *[1.0] * (len(order) - 1)]) / (first + len(order) - 1) * share * self.total
                leg = np.minimum(np.searchsorted(ends, when), len(order) - 1)
                heat = followed_along([order[k] for k in leg], RAMP_PIECE_S, room, station)
                if pieces > self.columns.size and not short_of(heat, self.requirement.levels):
                    rated.append((*self._rated_at(when, heat, RAMP_PIECE_S), order))
        passing = [(worst, effect, order) for worst, effect, order in rated if worst <= 1.0]
        return (passing[0][2], passing[0][1]) if (passing := sorted(passing)) else None

    def _divided(self, order: tuple[float, ...], counts: tuple[int, ...]) -> tuple[float, str]:
        """The smallest worst ratio to the required errors over divisions of the time among the soaks, and the effect."""
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
        """The worst ratio to the required errors, and its effect; divisions are reached on several ways, and rated once."""
        if (order, counts) not in self._rated:
            self._rated[order, counts] = self._rating(order, counts)
        return self._rated[order, counts]

    def _rating(self, order: tuple[float, ...], counts: tuple[int, ...]) -> tuple[float, str]:
        time: list[Array] = []
        heat, clock = np.repeat(np.asarray(order), counts), 0.0
        for waited, count in zip(self._waits(order), counts, strict=True):
            time.append(clock + waited + PIECE_S * np.arange(0.5, count))
            clock += waited + PIECE_S * count
        return self._rated_at(np.concatenate(time), heat, PIECE_S)

    def _rated_at(self, when: Array, heat: Array, piece_s: float) -> tuple[float, str]:
        """The worst ratio to the required errors and its effect, of pieces of measurement at times and temperatures (n,)."""
        rows = self._rows(when, heat)[..., self.columns]
        covariance = dwell_covariance(when, piece_s, self.against.noise, slowest=self.slowest)
        errors = self.requirement.ratio_to_required(normal_matrix(rows, covariance), self.columns)
        return float(errors.max()), self.names[self.columns[int(np.argmax(errors.max(axis=0)))]]

    def _rows(self, time: Array, heat: Array) -> Array:
        """Columns (axes, n, p) at zero force, in units of the required errors."""
        axes = self.against.state.axes
        state = settled_state(np.zeros((time.size, 3)), time, heat, np.zeros((time.size, 2)), RESTED_S, axes)
        columns = design.local_columns(self.sensor, state, design.starting_values(self.sensor, state))
        return columns * self.requirement.errors[:, None, :]

    def _waits(self, order: tuple[float, ...]) -> list[float]:
        return soak_waits(order, self.against.station, self.recipe.soak_min_s)
