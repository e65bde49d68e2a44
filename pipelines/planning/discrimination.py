"""Rival effects that a recipe is to tell apart, as a wish; and how far a recipe does."""

from __future__ import annotations

from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np

from inertial import design
from inertial.planning.discrimination import Discrimination
from pipelines.planning.requirement import Requirement, between, candidates
from schemas.errors import WrongUse
from schemas.units import MICRO

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pipelines.planning.plan import PlanContext

    Array = NDArray[np.float64]

ENOUGH = 50.0
"""Chi-square of the wrong effect in a lot from which the two are told apart."""

SIZE_UG = 100.0

CANDIDATES = 48
"""Directions to choose from: rivals part where their curves are farthest apart, and that lies between the usual ones."""


def parted(
    against: PlanContext,
    rivals: Sequence[str],
    levels: Sequence[float],
    *,
    size_ug: float = SIZE_UG,
    enough: float = ENOUGH,
    plan: str = "",
    see: Sequence[str] = (),
    verification: int = 1,
) -> Requirement:
    """The wish that a recipe tells rivals apart; the model of ``against`` is fitted anyway.

    Parameters
    ----------
    against : the textbook plan, whose poses say how large a column is
    levels : °C, the range of temperatures
    size_ug : what each rival adds where it is largest, µg
    enough : chi-square that the wrong one must leave in the recipe's lot, as a diagnosis counts it
    plan : named plan of poses to choose from
    """
    model = [e for e in against.recipe.effects if e not in rivals]
    effects = (*design_names(model), *rivals)
    _refuse(rivals, effects)
    rows = _columns(effects, against)
    rms = np.sqrt(np.mean(rows**2, axis=1))
    scale = 1.0 / np.where(rms > 0.0, rms, 1.0)
    names = [name for name, _ in design.local_names(design.split(effects)[0], 0)]
    columns = [tuple(k for k, name in enumerate(names) if name == rival) for rival in rivals]
    largest = np.max(np.abs(rows), axis=1)
    sizes = [
        size_ug / MICRO / np.where(largest > 0.0, largest, 1.0)[:, list(own)] / scale[:, list(own)] for own in columns
    ]
    base = tuple(k for k, name in enumerate(names) if name not in rivals)
    units = max(1, len(against.recipe.units))
    parting = Discrimination(base, tuple(columns), tuple(sizes), enough, units)
    return Requirement(
        wanted=scale,
        see=tuple(see),
        levels=(),
        candidates=candidates(against.station, plan, CANDIDATES),
        legal=between(levels),
        verification=verification,
        effects=effects,
        parting=parting,
    )


def design_names(model: Sequence[str]) -> tuple[str, ...]:
    """The effects of a model that each unit has for itself."""
    return tuple(effect.id for effect in design.split(model)[0])


def _refuse(rivals: Sequence[str], effects: Sequence[str]) -> None:
    if len(rivals) < 2:
        raise WrongUse(
            f"plan: --part names {len(rivals)} effect, two or more are needed; write third_order,odd_quadratic"
        )
    station = [effect.id for effect in design.split(effects)[1]]
    if station:
        raise WrongUse(
            f"plan: --part {station[0]}: an effect of the station, effects of the device are needed; 'tumbleline investigate' "
            "parts those of the station"
        )


def _columns(effects: Sequence[str], course: PlanContext) -> Array:
    sensor, _ = design.split(effects)
    return design.local_columns(sensor, course.state, design.starting_values(sensor, course.state))


def partings(wish: Requirement, course: PlanContext) -> list[dict[str, Any]]:
    """Chi-square that each rival leaves of each other in a recipe's lot; none where there are no rivals."""
    if wish.parting is None:
        return []
    rows = _columns(wish.effects, course) * wish.wanted[:, None, :]
    found = wish.parting.separations(np.swapaxes(rows, -1, -2) @ np.linalg.solve(course.covariance, rows))
    rivals = wish.effects[-len(wish.parting.rivals) :]
    return [
        {"true": true, "wrong": wrong, "chi_square": float(value)}
        for (true, wrong), value in zip(permutations(rivals, 2), found, strict=True)
    ]
