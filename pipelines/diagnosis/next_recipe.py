"""The recipe of the next measurement: the recipe of the dwells, continued by the steps that a diagnosis proposes.

The proposed steps alone have too few poses for a fit, and their expected χ² includes the dwells so far; so the recipe measures
both.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError

from schemas.poses import Pose, SoakPart
from schemas.recipe import Recipe
from schemas.toml_files import explain

SAME_SOAK_K = 0.5
"""Steps whose chamber temperature differs by less from the soak before them are part of that soak."""


def next_recipe(base: Recipe, rows: Sequence[dict[str, Any]], name: str) -> Recipe:
    """The recipe ``base`` followed by the proposed steps; its model is that of ``base``.

    A recipe file holds no formulas: those of a model file are left out.

    Parameters
    ----------
    rows : ``next_measurements`` of a diagnosis; rows that are not measurable are left out
    name : of the recipe

    Raises
    ------
    RecipeInvalid
        The steps do not fit the recipe, such as an angle that no recipe can have.
    """
    poses = [*base.poses]
    numbers = {(pose.outer_deg, pose.inner_deg): k for k, pose in reversed([*enumerate(poses, start=1)])}
    soaks = [_explicit(base, k) for k in range(len(base.temperatures_C))]
    for row in (row for row in rows if row.get("measurable", True)):
        angles = (row["outer_deg"], row["inner_deg"])
        if angles not in numbers:
            poses.append(Pose(name=f"n{len(poses) + 1:03d}", outer_deg=angles[0], inner_deg=angles[1]))
            numbers[angles] = len(poses)
        part = _soak_for(soaks, row)
        for _ in range(row.get("repeats", 1)):
            part["poses"].append(numbers[angles])
            part["waits_s"].append(row.get("wait_s", base.settle_s))
            part["off_s"].append(row.get("off_s", 0.0))
    changes = {
        "name": re.sub(r"[^a-z0-9._-]+", "-", name.lower()).strip("-._") or "next",
        "description": f"{base.name} and the steps that a diagnosis proposes",
        "poses": [pose.model_dump() for pose in poses],
        "soaks": [_tidied(part, base) for part in soaks],
        "temperatures_C": [part["temperature_C"] for part in soaks],
        "effects": [name for name in base.effects if name not in {formula.id for formula in base.formulas}],
        "formulas": [],
        "model_name": "",
        "model_version": 0,
    }
    try:
        return Recipe.model_validate({**base.model_dump(), **changes})
    except ValidationError as problem:
        raise explain(problem, f"recipe {changes['name']}", Recipe) from None


def reasons(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The purposes of the proposed steps, once each; empty without steps."""
    return list(dict.fromkeys(row["why"] for row in rows if row.get("measurable", True)))


def _explicit(base: Recipe, soak: int) -> dict[str, Any]:
    """A soak of the recipe with the numbers of its poses: "all poses" would include the added ones."""
    given = base.soaks[soak] if base.soaks else SoakPart(temperature_C=base.temperatures_C[soak])
    listed = given.poses if given.poses is not None else range(1, len(base.poses) + 1)
    return {
        **given.model_dump(),
        "poses": list(listed),
        "waits_s": list(base.waits_at(soak)),
        "off_s": list(base.off_at(soak)),
    }


def _soak_for(soaks: list[dict[str, Any]], row: dict[str, Any]) -> dict[str, Any]:
    """The soak that a step is measured in: the last one at its temperature, else a new one."""
    temperature = float(row["chamber_C"])
    if abs(soaks[-1]["temperature_C"] - temperature) >= SAME_SOAK_K:
        soaks.append(
            {
                "temperature_C": temperature,
                "poses": [],
                "verification": [],
                "waits_s": [],
                "off_s": [],
                "settled": row.get("soaked", True),
            }
        )
    return soaks[-1]


def _tidied(part: dict[str, Any], base: Recipe) -> dict[str, Any]:
    """A soak without waits and times without power of its own."""
    kept = dict(part)
    if all(wait == base.settle_s for wait in part["waits_s"]):
        kept["waits_s"] = None
    if not any(part["off_s"]):
        kept["off_s"] = None
    return kept
