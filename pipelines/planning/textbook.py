"""The textbook plan, 24 orthogonal poses at nine soaks up and down, 15 min each, 10 s dwells: its errors and visible effects."""

from collections.abc import Sequence

import numpy as np

from inertial import poses
from inertial.arrays import Array
from inertial.errors import NotIdentified
from inertial.planning.expected import expected_errors
from inertial.planning.visibility import visibilities
from inertial.state import State
from pipelines.planning.context import PlanContext, plan_context
from pipelines.planning.plan import identified
from pipelines.planning.requirement import numbered
from pipelines.schedule.planned_state import planned_state
from schemas.recipe import Recipe

LEVELS = 5
PART_SEEN = 0.05
"""Remaining fraction v from which a required effect counts as visible; the textbook plan's effects are required from twice it."""


def textbook(recipe: Recipe, levels: Sequence[float]) -> Recipe:
    """The textbook plan over a range of temperatures, for a recipe's device and model."""
    up = np.linspace(min(levels), max(levels), LEVELS)
    heat = _up_and_down(up.tolist() if up[0] < up[-1] else [float(up[0])])
    return recipe.model_copy(
        update={
            "name": "textbook",
            "poses": numbered("p", poses.plan("orthogonal24")),
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


def reference_errors(against: PlanContext, recipe: Recipe) -> Array:
    """Expected standard errors (axes, p), g per unit of the column, of a recipe's model under the textbook plan.

    Coefficients of effects that the textbook plan cannot identify (third_order on faces) have the errors of the recipe itself.
    """
    try:
        return identified(against).errors
    except NotIdentified:
        expected = identified(
            plan_context(recipe, against.station, against.noise, slowest=float(against.state.time[-1]))
        )
    model = list(recipe.effects)
    names = [name for name, _ in expected.names[0]]
    for effect in _hidden(against.state, model):
        model.remove(effect)
    there = expected_errors(model, against.state, against.covariance)
    errors = expected.errors.copy()
    errors[:, [k for k, name in enumerate(names) if name in model]] = there.errors
    return errors


def _hidden(state: State, model: Sequence[str]) -> list[str]:
    """Effects of a model that a plan cannot identify beside the effects before them."""
    visible: list[str] = []
    for effect in model:
        visibility = visibilities(state, visible, 1.0, [effect])
        if effect in ("bias", "scale", "misalignment") or (visibility and visibility[0].seen):
            visible.append(effect)
    return [effect for effect in model if effect not in visible]


def seen_by(against: PlanContext, levels: Sequence[float]) -> tuple[str, ...]:
    """Effects beside the model that are visible under the textbook plan, at its own temperatures and at these."""
    there = against.recipe.model_copy(update={"temperatures_C": _up_and_down(sorted(levels))})
    states = (against.state, planned_state(there, against.station, history=True))
    seen = [
        {s.effect for s in visibilities(state, there.effects, 1.0) if s.remaining_fraction >= 2.0 * PART_SEEN}
        for state in states
    ]
    return tuple(sorted(seen[0] & seen[1]))
