"""Search for the recipe with the least station time that meets a requirement."""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial.arrays import Array
from inertial.errors import NotIdentified
from inertial.planning.expected import Expected
from inertial.planning.pose_exchange import exchanged
from inertial.planning.visibility import visibilities
from pipelines.planning.context import PlanContext, plan_context
from pipelines.planning.discrimination import matrix_of
from pipelines.planning.lower_bound import lower_bound
from pipelines.planning.plan import identified
from pipelines.planning.requirement import Requirement, apart, mirrored, numbered, orders, turns
from pipelines.planning.textbook import PART_SEEN
from pipelines.planning.timed_design import FEWEST, MOST, PlanDesign, TimedDesign, fewest_dwells, short_of, spanned
from schemas.errors import RecipeInvalid
from schemas.poses import SoakPart
from schemas.recipe import Recipe

Progress = Callable[[str], None]

TRIED, TRIED_RAMPS = 3, 6
"""Numbers of orders of soaks, and of ramps with a length of their dwells, in which poses are exchanged."""

LIKELY = 12
"""Number of orders whose dwell counts are optimised, the best by the estimate from two sizes of a starting arrangement."""

ROUNDS = 4
"""Maximum number of exchanges per order; each shows the gain over the starting arrangement, and so the dwells needed."""

ROUGH = 1.2
"""Ratio to the requirement that a starting arrangement may have, because the first exchange of poses is expected to reduce it."""

NEAR = 0.985  # ratio to the requirement above which no fewer dwells are tried
SLOWER = 1.02  # ratio of station time to the best recipe so far above which a design is skipped
SPARE = 0.003  # margin below the required errors: counts are whole numbers


@dataclass(frozen=True)
class Optimum:
    """The recipe found, and the figures of the search.

    planned : the recipe on the station
    expected : its expected standard errors
    against : the textbook plan
    requirement : what it had to meet
    worst : its largest ratio to the requirement; met at ≤ 1
    ramp : whether it measures while the chamber ramps
    """

    planned: PlanContext
    expected: Expected
    against: PlanContext
    requirement: Requirement
    worst: float
    ramp: bool = False

    @property
    def share(self) -> float:
        """Station time over that of the textbook plan, both without the static record."""
        return self.planned.minutes / self.against.minutes


def optimise(
    recipe: Recipe,
    against: PlanContext,
    requirement: Requirement,
    progress: Progress,
    *,
    tolerance: float = 1.0,
    ramp: bool = False,
) -> Optimum:
    """The recipe with the least station time that meets a requirement.

    Orders of soaks are ranked by the station time of a starting arrangement with the dwells that each soak needs. In the best
    orders poses are exchanged (:mod:`inertial.planning.pose_exchange`), and dwells are added or removed until the requirement is
    just met.

    tolerance : ratio to the requirement up to which the nearest recipe is returned where none meets it, provided that it is
        quicker than the textbook plan
    ramp : whether the devices are measured while the chamber ramps, instead of in soaks
    Raises RecipeInvalid: no recipe that was tried meets the requirement; the message gives the smallest ratio reached.
    """
    search = RecipeSearch(recipe, against, requirement, ramp=ramp)
    best: PlanContext | None = None
    if requirement.prior is not None:  # what is enough without a prior is enough with it
        with suppress(RecipeInvalid):
            without = replace(requirement, prior=None)
            best = search.on_station(optimise(recipe, against, without, progress, ramp=ramp).planned.recipe)
    ranked = search.ranked()
    for number, (plan, _) in enumerate(ranked, start=1):
        soaks = ", ".join(f"{t:g}" for t in plan.order)
        progress(f"{'ramps to' if ramp else 'soaks at'} {soaks} °C (order {number} of {len(ranked)})")
        best = search.best(plan, best)
    best = best or search.nearest_within(tolerance)
    if best is None:
        raise RecipeInvalid(_refusal(search))
    return Optimum(best, identified(best), against, requirement, float(np.max(search.reached(best))), ramp)


def _refusal(search: "RecipeSearch") -> str:
    """Why there is no recipe, the smallest ratio reached, and the lower bound of the station time."""
    requirement, near = search.requirement, search.nearest
    start = f"plan optimise: no recipe of up to {MOST} dwells "
    if search.unseen:
        unseen = ", ".join(search.unseen)
        return f"{start}makes {unseen} visible; require fewer effects (--wanted) or more temperatures (--set temperatures=…)"
    if requirement.discrimination is not None:
        needed = requirement.discrimination.chi_square
        reached = f"χ² {needed / near**2:.2g}, {needed:g} is needed"
        enough = f"{near:.1f} times the size is enough (--set size=…)"
        return f"{start}discriminates between these effects: the best reaches {reached}; {enough}"
    lower = lower_bound(search.recipe, search.against, requirement, ramp=search.ramp)
    if lower is None:
        bound = "; uninterrupted measurement for the textbook plan's time does not reach them either: wander limits the bias"
    else:
        bound = f"; uninterrupted measurement needs {100.0 * lower.share:.0f} % of the textbook plan's time, for {lower.effect}"
    nearest = f": the best has {near:.3f} times those" if math.isfinite(near) else ""
    return f"{start}reaches the required errors{nearest}{bound}; allow more by --set factor=… or --wanted, or other temperatures"


class RecipeSearch:
    """Search over plan designs for one recipe, station and requirement."""

    def __init__(self, recipe: Recipe, against: PlanContext, requirement: Requirement, *, ramp: bool = False) -> None:
        self.recipe, self.against, self.requirement, self.ramp = recipe, against, requirement, ramp
        self.timed = TimedDesign(
            recipe, against.station, against.noise, requirement, slowest=float(against.state.time[-1])
        )
        self.nearest = math.inf
        self.near: tuple[float, PlanContext] | None = None
        self.unseen: list[str] = []

    def ranked(self) -> list[tuple[PlanDesign, float]]:
        """Designs with the fewest dwells in the best orders of soaks, and their station times in s, the quickest first."""
        soak_orders = orders(self.requirement, self.against.station, self.recipe.soak_min_s, ramp=self.ramp)
        dwell_s = self.timed.dwell_lengths()[0]
        # ramps are few, and a ramp that does not get far enough says nothing of a longer ramp
        likely = [(0.0, order) for order in soak_orders]
        if not self.ramp:
            likely = sorted((self.estimated_seconds(order, dwell_s), order) for order in soak_orders)[:LIKELY]
        tried: list[tuple[float, PlanDesign]] = []
        for seconds, order in likely:
            if math.isfinite(seconds):
                tried += [self.with_fewest_dwells(order, length) for length in self.timed.dwell_lengths()]
        chosen: list[tuple[PlanDesign, float]] = []
        for seconds, plan in sorted(tried, key=lambda trial: trial[0]):
            used = {other.order for other, _ in chosen}
            # the starting arrangement says little of a ramp: other lengths of its dwells are tried beside it
            again = not self.ramp and bool({plan.order, mirrored(plan.order)} & used)
            if math.isfinite(seconds) and not again:
                chosen.append((plan, seconds))
        return chosen[: TRIED_RAMPS if self.ramp else TRIED]

    def allowed(self, ratio: Array) -> Array:
        """Ratios to the requirement that a starting arrangement may have; an exchange cannot improve pose-independent columns."""
        if self.requirement.discrimination is not None:
            return np.full(ratio.shape, ROUGH)
        return np.where(self.timed.pose_independent(), 1.0, ROUGH)

    def estimated_seconds(self, order: tuple[float, ...], dwell_s: float) -> float:
        """Estimated station time of an order, s, from two sizes of a starting arrangement; infinite where no size is enough."""
        few, many = 8, 40
        worst: list[float] = []
        ends: list[float] = []
        for count in (few, many):
            ratio, seconds = self.timed.ratio_and_seconds(PlanDesign(order, (count,) * len(order), dwell_s, self.ramp))
            worst.append(float(np.max(ratio / self.allowed(ratio))))
            ends.append(seconds)
        self.nearest = min(self.nearest, worst[1])
        slope = math.log(worst[1] / worst[0]) / math.log(many / few)
        if not slope < -0.02:
            return ends[0] if worst[0] <= 1.0 else math.inf
        count = max(float(FEWEST), many * worst[1] ** (-1.0 / slope))
        if count * len(order) > 2.0 * MOST:
            return math.inf
        return ends[0] + (ends[1] - ends[0]) * (count - few) / (many - few)

    def with_fewest_dwells(self, order: tuple[float, ...], dwell_s: float) -> tuple[float, PlanDesign]:
        """The design with the fewest dwells, and its station time in s; infinite where no number is enough."""
        plan = PlanDesign(order, (FEWEST,) * len(order), dwell_s, self.ramp)
        ratio, _ = self.timed.ratio_and_seconds(plan)
        fewest = fewest_dwells(self.timed, plan, self.allowed(ratio))
        return (math.inf, plan) if fewest is None else (self.timed.ratio_and_seconds(fewest)[1], fewest)

    def best(self, plan: PlanDesign, best: PlanContext | None) -> PlanContext | None:
        """The quicker of the best recipe so far and that found by exchanges in the soaks of a design."""
        now: PlanDesign | None = plan
        for _ in range(ROUNDS):
            if now is None or sum(now.counts) > MOST or self.slower(now, best):
                break
            designed = self.designed(now)
            try:
                reached = self.reached(designed)
            except NotIdentified:
                break
            worst = float(np.max(reached))
            self.nearest = min(self.nearest, worst)
            if self.near is None or worst < self.near[0]:
                self.near = (worst, designed)
            if worst <= 1.0 and (best is None or designed.minutes < best.minutes):
                self.unseen = self.not_visible(designed)
                best = best if self.unseen else designed
            if NEAR < worst <= 1.0 or self.unseen:
                break
            before = now
            now = fewest_dwells(self.timed, plan, (1.0 - SPARE) * self.timed.ratio_and_seconds(now)[0] / reached)
            if self.ramp and worst > 1.0 and (now is None or sum(now.counts) <= sum(before.counts)):
                # more dwells on ramps are no longer a version of fewer: the devices are elsewhere at each of them
                now = replace(before, counts=tuple(math.ceil(worst * count) for count in before.counts))
        return best

    def nearest_within(self, tolerance: float) -> PlanContext | None:
        """The recipe with the smallest ratio, if within tolerance, quicker than the textbook plan, and all effects visible."""
        if self.near is None or self.near[0] > tolerance:
            return None
        nearest = self.near[1]
        quicker = nearest.minutes < self.against.minutes
        return nearest if quicker and not self.not_visible(nearest) else None

    def slower(self, plan: PlanDesign, best: PlanContext | None) -> bool:
        """Whether a design clearly takes longer than the best recipe so far."""
        return best is not None and self.timed.ratio_and_seconds(plan)[1] / 60.0 > SLOWER * best.minutes

    def designed(self, plan: PlanDesign) -> PlanContext:
        """The recipe of a design after an exchange of poses, on the station."""
        slots, start = self.timed.slots(plan)
        choice = exchanged(slots, start, self.requirement.objective)
        choice = spanned(self.timed.force, choice, plan.fixed, self.recipe.span_min_g, self.recipe.sensor_axes)
        context = self.on_station(self._recipe(plan, choice))
        return self.reaching(context) if plan.ramp else context

    def on_station(self, recipe: Recipe) -> PlanContext:
        """A recipe on the station of the search."""
        noise, prior = self.against.noise, self.requirement.prior
        return plan_context(recipe, self.against.station, noise, slowest=self.timed.slowest, prior=prior)

    def reaching(self, context: PlanContext) -> PlanContext:
        """A recipe on ramps that gets to both ends of the range: short moves after an exchange of poses also end a ramp sooner.

        The ramp that gets nearest to an end goes on through its own poses, in their order, until the device is there.
        """
        low, high = min(self.requirement.levels), max(self.requirement.levels)
        poses = [part.poses or [] for part in context.recipe.soaks]
        for added in range(MOST):
            heat = context.heat
            if not short_of(heat, self.requirement.levels):
                break
            end = low if heat.min() - low >= high - heat.max() else high
            step = [activity.step for activity in context.activities if activity.kind == "dwell"]
            towards = [k for k, planned in enumerate(step) if planned.temperature == end]
            leg = step[min(towards, key=lambda k: abs(heat[k] - end))].soak
            soaks = list(context.recipe.soaks)
            more = poses[leg][1 + added % (len(poses[leg]) - 1)]  # a ramp begins and ends with the same pose
            soaks[leg] = soaks[leg].model_copy(update={"poses": [*(soaks[leg].poses or []), more]})
            context = self.on_station(context.recipe.model_copy(update={"soaks": soaks}))
        return context

    def reached(self, context: PlanContext) -> Array:
        """Ratios of a recipe to the requirement, with every dwell at its planned time; met at ≤ 1."""
        expected = identified(context)
        if self.requirement.discrimination is None:
            ratio = expected.errors / self.requirement.errors
            return self.timed.within(ratio, context.heat) if self.ramp else ratio
        return self.requirement.ratio_to_required(matrix_of(self.requirement, context))

    def _recipe(self, plan: PlanDesign, choice: NDArray[np.intp]) -> Recipe:
        used = np.unique(choice)
        number = {int(c): k for k, c in enumerate(used, start=1)}
        chosen = self.requirement.candidates[used]
        verification = apart(chosen, self.recipe.verification)
        soaks = [
            SoakPart(
                temperature_C=t,
                poses=[number[int(c)] for c in choice[plan.group == soak]],
                verification=turns(len(verification), self.requirement.verification, soak, len(plan.order)),
                settled=not plan.ramp,
            )
            for soak, t in enumerate(plan.order)
        ]
        where = f"on {len(soaks)} ramps" if plan.ramp else f"at {len(soaks)} soaks"
        return self.recipe.model_copy(
            update={
                "name": f"{self.recipe.name}-{'quick' if plan.ramp else 'optimal'}",
                "description": f"{len(chosen)} poses {where}, by 'tumbleline plan optimise'",
                "poses": numbered("p", chosen),
                "verification": verification,
                # a ramp is long, and what wanders slowly is to be averaged
                "verification_order": "interleaved" if plan.ramp else self.recipe.verification_order,
                "temperatures_C": [float(t) for t in plan.order],
                "soaks": soaks,
                "dwell_s": plan.dwell_s,
            }
        )

    def not_visible(self, context: PlanContext) -> list[str]:
        """Required effects that are not visible."""
        see = self.requirement.see
        seen = visibilities(context.state, self.recipe.effects, 1.0, see) if see else []
        return [s.effect for s in seen if s.remaining_fraction < PART_SEEN]
