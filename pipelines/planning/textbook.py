"""The textbook plan: 24 orthogonal poses at nine soaks up and down, 15 min soak, 10 s dwells; and what it sees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inertial import poses
from inertial.errors import NotIdentified
from inertial.planning.expected import expected_errors
from inertial.planning.visibility import sights
from pipelines.planning.plan import identified, plan_context
from pipelines.planning.verification_poses import numbered
from pipelines.schedule.planned_state import planned_state

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from inertial.state import State
    from pipelines.planning.plan import PlanContext
    from schemas.recipe import Recipe

    Array = NDArray[np.float64]

LEVELS = 5
PART_SEEN = 0.05
"""Part v that a recipe must see of an effect that is asked for; of what the textbook plan sees by twice that."""


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
    """Errors (3, p) in g per unit of the column that the textbook plan lets expect of a recipe's model.

    Coefficients of effects that it cannot identify at all, as faces cannot a cubic, have the errors of the recipe itself.
    """
    try:
        return identified(against).errors
    except NotIdentified:
        own = identified(plan_context(recipe, against.station, against.noise, slowest=float(against.state.time[-1])))
    model = list(recipe.effects)
    names = [name for name, _ in own.names[0]]
    for effect in _hidden(against.state, model):
        model.remove(effect)
    there = expected_errors(model, against.state, against.covariance)
    found = own.errors.copy()
    found[:, [k for k, name in enumerate(names) if name in model]] = there.errors
    return found


def _hidden(state: State, model: Sequence[str]) -> list[str]:
    """Effects of a model that a plan cannot identify beside those before them."""
    kept: list[str] = []
    for effect in model:
        sight = sights(state, kept, 1.0, [effect])
        if effect in ("bias", "scale", "misalignment") or (sight and sight[0].seen):
            kept.append(effect)
    return [effect for effect in model if effect not in kept]


def seen_by(against: PlanContext, levels: Sequence[float]) -> tuple[str, ...]:
    """Effects that the textbook plan sees beside its model, as far as these temperatures allow it, ageing and hysteresis too."""
    there = against.recipe.model_copy(update={"temperatures_C": _up_and_down(sorted(levels))})
    states = (against.state, planned_state(there, against.station, history=True))
    seen = [{s.effect for s in sights(state, there.effects, 1.0) if s.left >= 2.0 * PART_SEEN} for state in states]
    return tuple(sorted(seen[0] & seen[1]))
