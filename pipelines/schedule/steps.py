"""The steps of a capture: every record of a recipe, in order."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from schemas.recipe import Pose, Recipe

Kind = Literal["dwell", "verification", "allan"]


@dataclass(frozen=True)
class Step:
    """One record to take: its number, what it is for, the soak that it belongs to, and the pose.

    wait_s : after the move; the recipe's where None
    off_s : without power before the move
    settled : whether the devices settle at the soak's temperature first, or are read while they follow the chamber
    """

    record: int
    kind: Kind
    soak: int
    temperature: float
    pose: Pose
    wait_s: float | None = None
    settled: bool = True
    off_s: float = 0.0


def steps(recipe: Recipe) -> list[Step]:
    """Every record of a recipe in order: per temperature the poses, then those for verification; the static record last.

    With ``verification_order = "interleaved"`` those for verification are spread evenly among the poses of their soak.

    The static record has a soak of its own, unless it is taken at the last temperature.
    """
    found: list[Step] = []
    for soak, temperature in enumerate(recipe.temperatures_C):
        first = len(found)
        poses, waits, settled = recipe.poses_at(soak), recipe.waits_at(soak), recipe.settles_at(soak)
        for pose, wait, off in zip(poses, waits, recipe.off_at(soak), strict=True):
            found.append(Step(len(found), "dwell", soak, temperature, pose, wait, settled, off))
        for pose in recipe.verification_at(soak):
            found.append(Step(len(found), "verification", soak, temperature, pose, settled=settled))
        if recipe.verification_order == "interleaved":
            found = [*found[:first], *_interleaved(found[first:], first)]
    if recipe.static_record_s > 0.0:
        again = recipe.static_temperature_C == recipe.temperatures_C[-1]
        soak = len(recipe.temperatures_C) - (1 if again else 0)
        found.append(Step(len(found), "allan", soak, recipe.static_temperature_C, recipe.static_pose))
    return found


def _interleaved(soak: list[Step], first: int) -> list[Step]:
    """The records of a soak with those for verification spread among the others, numbered anew from ``first``."""
    checks = [step for step in soak if step.kind == "verification"]
    others = [step for step in soak if step.kind != "verification"]
    places = [(k + 0.5) / len(others) for k in range(len(others))] + [
        (k + 0.5) / len(checks) for k in range(len(checks))
    ]
    order = sorted(range(len(soak)), key=lambda k: (places[k], k))
    every = [*others, *checks]
    return [replace(every[k], record=first + n) for n, k in enumerate(order)]
