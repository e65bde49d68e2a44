"""The order of a recipe's soaks and poses with which its model is known first: nothing is added, nothing left out.

Of the orders of soaks the one is taken that reaches the required errors, at both ends of the range, in the least station time;
the soaks that are not needed for that follow, the nearest first. Within a soak each pose is the one that lowers the variances
most per time of its move and dwell. Ramps keep their order, which their temperatures decide, and so do poses with waits of their
own or without power.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, permutations

import numpy as np

from inertial import design
from inertial.arrays import Array
from inertial.errors import NotIdentified
from inertial.fits.known import looks_at, noise_guard
from inertial.planning.expected import expected_errors
from inertial.planning.pose_exchange import CRITERIA
from pipelines.planning.context import PlanContext, plan_context
from pipelines.planning.requirement import soak_seconds
from pipelines.planning.timed_design import short_of
from pipelines.schedule.planned_state import state_of
from pipelines.schedule.timing import Activity, StationPose, move_seconds
from pipelines.stages.noisy_fit import FEWEST_TO_SPARE
from schemas.errors import RecipeInvalid
from schemas.poses import SoakPart
from schemas.recipe import Recipe
from schemas.station import StationConfig

LONGEST = 6
"""Soaks of an order that is searched: a plan that needs more is known about as late in any order."""

MANY = 40
"""Orders of one length that are compared, the quickest by their soaks."""

COMPARED = 2
"""Lengths of orders that are completed and compared, from the shortest that is enough."""

FIRST_MATRIX = 1e-3
"""Information about every coefficient before the first dwell, over what is required: without any a matrix is singular."""


LEVERAGE = 0.5
"""Largest share of a dwell's error in the fit of that dwell: with less, most of it shows in the residuals, and so in the noise.

With one dwell at the end of the range it is one: its error decides a coefficient over temperature, and nothing tells.
"""

SINGULAR = 1e-5
"""Smallest over largest singular value of scaled columns that determine all coefficients."""


@dataclass(frozen=True)
class Ordered:
    """A recipe in its new order, with the minutes until it is known then, ``until``, and as given, ``before``; None: never.

    They are those of the uncertainties alone: the figures of a device, and the effects that it is asked to show, are not planned.
    """

    recipe: Recipe
    until: float | None
    before: float | None


def ordered(context: PlanContext, required: Array) -> Ordered:
    """A recipe in the order with which it is known first.

    Parameters
    ----------
    required : (axes, p), standard errors, g per unit of the column; infinite where none is asked for

    Raises RecipeInvalid: the recipe measures on ramps, whose order is that of their temperatures.
    """
    recipe = context.recipe
    parts = _parts(recipe)
    if not all(part.settled for part in parts):
        raise RecipeInvalid(
            f"recipe {recipe.name}: it measures on ramps, soaks that settle are needed to put them into another "
            "order; leave it as it is",
            key="soaks",
        )
    tried = [
        _with(recipe, [_by_information(context, part, required) for part in soaks])
        for soaks in _orders(context, parts, required)
    ]
    until = [known_after(_planned(context, plan), required) for plan in tried]
    best = min(range(len(tried)), key=lambda k: (math.inf if until[k] is None else until[k], k))
    before, after = known_after(context, required), until[best]
    if before is not None and (after is None or before <= after):
        return Ordered(recipe, before, before)
    return Ordered(tried[best], after, before)


def look_counts(activities: Sequence[Activity], station: StationConfig, recipe: Recipe) -> list[int]:
    """Numbers of dwells of the fit after which a run of a recipe looks: from the first with which the model can be judged.

    They reach both ends of the range, spare enough for the noise, and no dwell decides a coefficient alone (:data:`LEVERAGE`).
    """
    dwells = [activity for activity in activities if activity.kind == "dwell"]
    state = state_of(activities, station, recipe, history=True)
    sensor, _ = design.split(recipe.effects)
    columns = design.local_columns(sensor, state, design.starting_values(sensor, state))
    heat = np.zeros(0) if state.temperature is None else state.temperature

    def judged(count: int) -> bool:
        reaches = short_of(heat[:count], recipe.temperatures_C) <= 0.0
        return reaches and _leverage(columns[:, :count]) <= LEVERAGE

    ready = (k for k in range(columns.shape[-1] + FEWEST_TO_SPARE, len(dwells)) if judged(k))
    return [count for count in looks_at(next(ready, len(dwells)), len(dwells)) if judged(count)]


def _leverage(columns: Array) -> float:
    """Largest part of a dwell's error that its own fit absorbs, of columns (axes, n, p); 1 where they are not determined."""
    size = np.linalg.norm(columns, axis=-2, keepdims=True)
    left, value, _ = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
    if np.any(value[:, -1] <= SINGULAR * value[:, 0]):
        return 1.0
    return float(np.max(np.sum(left**2, axis=-1)))


def known_after(context: PlanContext, required: Array) -> float | None:
    """Minutes of station time after which the uncertainties of a lot with the planned noise are those that are asked for.

    Those of the whole plan where no look says so, and its end does, which needs no allowance; None where it does not, either.
    """
    dwells = [activity for activity in context.activities if activity.kind == "dwell"]
    counts = look_counts(context.activities, context.station, context.recipe)
    for count in counts:
        until = dwells[count - 1]
        if _ratio(context, count, required, len(counts)) <= 1.0:
            return (until.start + until.seconds) / 60.0
    return context.minutes if _ratio(context, len(dwells), required, 0) <= 1.0 else None


def _ratio(context: PlanContext, count: int, required: Array, looks: int) -> float:
    """Largest ratio of expected to required error with the first dwells, with the allowance of so many looks at its own noise.

    Infinite where they do not determine the model, or leave nothing to judge the noise by.
    """
    spare = max(1, len(context.recipe.units)) * len(required) * (count - required.shape[1])
    if spare <= 0:
        return math.inf
    last = [activity.step.record for activity in context.activities if activity.kind == "dwell"][count - 1]
    taken = [activity for activity in context.activities if activity.step.record <= last]
    state = state_of(taken, context.station, context.recipe, history=True)
    try:
        found = expected_errors(context.recipe.effects, state, context.covariance[:count, :count], prior=context.prior)
    except NotIdentified:
        return math.inf
    guard = noise_guard(spare, looks) if looks else 1.0
    return float(np.max(found.errors / required, initial=0.0)) * guard


def _parts(recipe: Recipe) -> list[SoakPart]:
    """The soaks of a recipe, each with the poses that it measures."""
    if recipe.soaks:
        return list(recipe.soaks)
    return [SoakPart(temperature_C=t, poses=list(range(1, len(recipe.poses) + 1))) for t in recipe.temperatures_C]


def _with(recipe: Recipe, parts: Sequence[SoakPart]) -> Recipe:
    heat = [part.temperature_C for part in parts]
    return recipe.model_copy(update={"soaks": list(parts), "temperatures_C": heat})


def _planned(context: PlanContext, recipe: Recipe) -> PlanContext:
    return plan_context(recipe, context.station, context.noise, prior=context.prior)


def _orders(context: PlanContext, parts: list[SoakPart], required: Array) -> list[list[SoakPart]]:
    """Orders of the soaks to compare: as given, and those with which the model is known first."""
    recipe, station = context.recipe, context.station
    ends = {min(recipe.temperatures_C), max(recipe.temperatures_C)}
    names = [part.model_dump_json() for part in parts]
    chosen: list[list[SoakPart]] = [parts]
    looks = max(1, len(look_counts(context.activities, station, recipe)))
    for length in range(len(ends), min(LONGEST, len(parts)) + 1):
        alike = {
            tuple(names[k] for k in order): order
            for order in permutations(range(len(parts)), length)
            if ends <= {parts[k].temperature_C for k in order} and _apart(parts, order)
        }
        quickest = sorted(
            alike.values(),
            key=lambda order: soak_seconds([parts[k].temperature_C for k in order], station, recipe.soak_min_s),
        )[:MANY]
        planned = [(_planned(context, _with(recipe, [parts[k] for k in order])), list(order)) for order in quickest]
        enough = [
            (known_after(plan, required) or plan.minutes, order)
            for plan, order in planned
            if _ratio(plan, plan.state.time.size, required, looks) <= 1.0
        ]
        if enough:
            chosen.append(_completed(parts, min(enough)[1]))
            if len(chosen) > COMPARED:
                break
    return chosen


def _completed(parts: list[SoakPart], order: list[int]) -> list[SoakPart]:
    """An order with the soaks that it leaves out behind it, the nearest first; as given where they do not fit behind it."""
    left = [k for k in range(len(parts)) if k not in order]
    while left:
        now = parts[order[-1]].temperature_C
        # a repeated temperature is no separate soak: it comes when another lies between
        nearest = min(left, key=lambda k: (parts[k].temperature_C == now, abs(parts[k].temperature_C - now), k))
        order.append(nearest)
        left.remove(nearest)
    return [parts[k] for k in order] if _apart(parts, order) else parts


def _apart(parts: list[SoakPart], order: Sequence[int]) -> bool:
    """Whether no temperature comes twice in a row."""
    return all(parts[a].temperature_C != parts[b].temperature_C for a, b in pairwise(order))


def _by_information(context: PlanContext, part: SoakPart, required: Array) -> SoakPart:
    """A soak with its poses in the order of their information per station time, from the first on."""
    recipe, noise = context.recipe, context.noise
    numbers = part.poses or []
    if part.waits_s or part.off_s or len(numbers) < 2:
        return part
    sensor, _ = design.split(recipe.effects)
    planned = _planned(context, _with(recipe, [part]))
    columns = design.local_columns(sensor, planned.state, design.starting_values(sensor, planned.state))
    scale = np.where(np.isfinite(required), required, 1e3 * noise.error(recipe.dwell_s))
    rows = columns * scale[:, None, :] / noise.error(recipe.dwell_s)
    poses = recipe.poses
    beside = recipe.settle_s + context.station.pace.record_s + recipe.dwell_s
    matrix = FIRST_MATRIX * np.stack([np.eye(rows.shape[-1])] * len(rows))
    now, left, order = StationPose(), list(range(len(numbers))), list[int]()
    value = CRITERIA["A"]
    while left:
        pose = [poses[numbers[k] - 1] for k in left]
        tried = matrix + np.einsum("akp,akq->kapq", rows[:, left], rows[:, left])
        gain = float(value(matrix)) - value(tried)
        seconds = np.array([move_seconds(now, target, context.station) for target in pose]) + beside
        best = int(np.argmax(gain / seconds))
        matrix, now = tried[best], replace(now, outer=pose[best].outer_deg, inner=pose[best].inner_deg)
        order.append(numbers[left.pop(best)])
    return part.model_copy(update={"poses": order})
