"""Discrimination between rival effects as a requirement, and the separation that a recipe reaches."""

from collections.abc import Sequence
from itertools import permutations
from typing import Any

import numpy as np

from inertial import design
from inertial.arrays import Array
from inertial.planning.discrimination import Discrimination
from pipelines.planning.context import PlanContext
from pipelines.planning.requirement import Requirement, candidates, temperature_choices
from schemas.errors import WrongUse
from schemas.units import MICRO

ENOUGH = 50.0  # χ² of the wrong effect over a lot from which two effects count as discriminated
SIZE_UG = 100.0  # default size of each rival where it is largest, µg
CANDIDATES = 48
"""Number of candidate directions: rivals differ most between the faces and edges, so more directions are offered."""


def discrimination_requirement(
    against: PlanContext,
    rivals: Sequence[str],
    levels: Sequence[float],
    *,
    size_ug: float = SIZE_UG,
    enough: float = ENOUGH,
    plan: str = "",
    see: Sequence[str] = (),
) -> Requirement:
    """The requirement that a recipe discriminates between rivals; the model of ``against`` is fitted beside them.

    against : the textbook plan; its poses scale the columns
    levels : °C, the temperature range
    size_ug : contribution of each rival where it is largest, µg
    enough : χ² of the wrong rival over the recipe's lot, as a diagnosis computes it
    plan : named plan of poses to choose from
    Raises WrongUse: fewer than two rivals, or an effect of the station among them.
    """
    model = [e for e in against.recipe.effects if e not in rivals]
    effects = (*(effect.id for effect in design.split(model)[0]), *rivals)
    _refuse(rivals, effects)
    columns = _columns(effects, against)
    rms = np.sqrt(np.mean(columns**2, axis=1))
    scale = 1.0 / np.where(rms > 0.0, rms, 1.0)
    names = [name for name, _ in design.local_names(design.split(effects)[0], 0)]
    places = [tuple(k for k, name in enumerate(names) if name == rival) for rival in rivals]
    largest = np.max(np.abs(columns), axis=1)
    sizes = [
        size_ug / MICRO / np.where(largest > 0.0, largest, 1.0)[:, list(indices)] / scale[:, list(indices)]
        for indices in places
    ]
    base = tuple(k for k, name in enumerate(names) if name not in rivals)
    units = max(1, len(against.recipe.units))
    return Requirement(
        errors=scale,
        see=tuple(see),
        levels=(),
        candidates=candidates(against.station, plan, CANDIDATES),
        optional_levels=temperature_choices(levels),
        effects=effects,
        discrimination=Discrimination(base, tuple(places), tuple(sizes), enough, units),
    )


def _refuse(rivals: Sequence[str], effects: Sequence[str]) -> None:
    if len(rivals) < 2:
        raise WrongUse(
            f"plan: --criterion T:names {len(rivals)} effect, two or more are needed; write third_order,odd_quadratic"
        )
    station = [effect.id for effect in design.split(effects)[1]]
    if station:
        raise WrongUse(
            f"plan: --criterion T:{station[0]}: found an effect of the station, effects of the device are needed; "
            "'tumbleline investigate' discriminates between effects of the station"
        )


def _columns(effects: Sequence[str], context: PlanContext) -> Array:
    sensor, _ = design.split(effects)
    return design.local_columns(sensor, context.state, design.starting_values(sensor, context.state))


def matrix_of(requirement: Requirement, context: PlanContext) -> Array:
    """Normal matrices (axes, p, p) of a recipe, of the columns of a requirement's effects in units of its errors."""
    columns = _columns(requirement.effects, context) * requirement.errors[:, None, :]
    return np.swapaxes(columns, -1, -2) @ np.linalg.solve(context.covariance, columns)


def rival_separations(requirement: Requirement, context: PlanContext) -> list[dict[str, Any]]:
    """χ² of every wrong rival over a recipe's lot, one row per ordered pair; empty where no rivals are named."""
    if requirement.discrimination is None:
        return []
    separations = requirement.discrimination.separations(matrix_of(requirement, context))
    rivals = requirement.effects[-len(requirement.discrimination.rivals) :]
    return [
        {"true": true, "wrong": wrong, "chi_square": float(value)}
        for (true, wrong), value in zip(permutations(rivals, 2), separations, strict=True)
    ]
