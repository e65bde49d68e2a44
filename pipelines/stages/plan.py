"""What a recipe can see, and what it costs, before any chamber time is spent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inertial.planning import sights
from pipelines.planned import planned_state

if TYPE_CHECKING:
    from inertial.planning import Sight
    from schemas.recipe import Recipe

MICRO = 1e6
_RAMP_K_PER_MIN = 3.0
_MOVE_S = 6.0


def plan(recipe: Recipe, noise_density_ug: float, wander_ug: float) -> dict[str, Any]:
    """How a recipe sees every effect of the catalogue, as a document with the keys that other programs read.

    Parameters
    ----------
    noise_density_ug : one-sided white noise of the device, µg/√Hz
    wander_ug : standard deviation of what a dwell's mean wanders from dwell to dwell (flicker), µg
    """
    state = planned_state(recipe)
    white = noise_density_ug / np.sqrt(2.0 * recipe.dwell_s)
    error = float(np.hypot(white, wander_ug)) / MICRO
    found = sights(state, recipe.effects, error)
    return {
        "recipe": recipe.name,
        "model": list(recipe.effects),
        "poses": len(recipe.poses),
        "temperatures_C": list(recipe.temperatures_C),
        "dwell_error_ug": {"white": white, "wander": wander_ug, "together": MICRO * error},
        "minutes": minutes(recipe),
        "effects": [_row(s) for s in found],
    }


def minutes(recipe: Recipe) -> dict[str, float]:
    """Station time of a recipe in minutes: ramps and soaks, moves with settling, dwells, the static record."""
    poses = len(recipe.poses) + len(recipe.verification)
    soaks = len(recipe.temperatures_C)
    change = np.abs(np.diff(np.array([25.0, *recipe.temperatures_C])))
    parts = {
        "soaks": soaks * recipe.soak_min_s / 60.0 + float(change.sum()) / _RAMP_K_PER_MIN,
        "moves": soaks * poses * (_MOVE_S + recipe.settle_s) / 60.0,
        "dwells": soaks * poses * recipe.dwell_s / 60.0,
        "static_record": recipe.static_record_s / 60.0,
    }
    return {**{k: round(v, 2) for k, v in parts.items()}, "total": round(sum(parts.values()), 2)}


def _row(sight: Sight) -> dict[str, Any]:
    finite = np.isfinite(sight.floor)
    return {
        "effect": sight.effect,
        "seen": sight.seen,
        "left": sight.left,
        "left_by_axis": list(sight.by_axis),
        "variance_inflation": sight.variance_inflation if sight.left > 0.0 else None,
        "floor_ug": MICRO * sight.floor if finite else None,
        "alias": list(sight.alias),
        "breaker": sight.breaker,
    }
