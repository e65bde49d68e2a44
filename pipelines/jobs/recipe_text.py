"""A resolved recipe as the text of a recipe file."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

from schemas.errors import WrongUse
from schemas.recipe import RecipeFile

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from schemas.recipe import Pose, Recipe, SoakPart

WIDTH = 100
PLAIN = (
    *("name", "description", "device", "units", "seed", "local_gravity_m_s2", "zero_output"),
    *("soak_min_s", "allow_short_soak", "settle_s", "dwell_s", "rate_hz", "static_record_s", "static_temperature_C"),
    *("span_min_g", "limits"),
)


def recipe_text(recipe: Recipe, remarks: Iterable[str] = ()) -> str:
    """The text of a recipe file that reads as this recipe; keys that stand at their defaults are left out.

    Parameters
    ----------
    remarks : lines for the head of the file, without the sign of a remark

    Raises
    ------
    WrongUse
        The model has formulas of its own, which only a model file can hold.
    """
    if recipe.formulas:
        raise WrongUse(
            f"recipe {recipe.name}: its model has the formula '{recipe.formulas[0].id}', a recipe file holds effects of the "
            "catalogue only; give the effects with --effects, and name the model file in the recipe that is written"
        )
    lines = [f"# {remark}" for remark in remarks]
    for key in PLAIN:
        value = getattr(recipe, key)
        if value != RecipeFile.model_fields[key].default:
            lines.append(f"{key} = {_value(value)}")
    lines += ["", *_listed("effects", [json.dumps(effect) for effect in recipe.effects])]
    lines += ["", "# outer, inner in degrees; numbers below count from 1", *_listed("poses", _angles(recipe.poses))]
    once, times = _repeated(recipe.verification)
    if once:
        lines += _listed("verification", _angles(once))
    if times > 1:
        lines.append(f"verification_repeats = {times}")
    if recipe.static_record_s > 0.0:
        lines += _listed("static_pose", [str(recipe.static_pose.outer_deg), str(recipe.static_pose.inner_deg)])
    if not recipe.soaks:
        lines += _listed("temperatures_C", [str(t) for t in recipe.temperatures_C])
    for part in recipe.soaks:
        lines += _soak_lines(part)
    return "\n".join(lines) + "\n"


def _soak_lines(part: SoakPart) -> list[str]:
    """The table of one soak."""
    lines = ["", "[[soaks]]", f"temperature_C = {part.temperature_C}"]
    for key in ("poses", "verification", "waits_s"):
        numbers = getattr(part, key)
        if numbers is not None:
            lines += _listed(key, [str(k) for k in numbers])
    return lines if part.settled else [*lines, "settled = false"]


def _repeated(poses: list[Pose]) -> tuple[list[Pose], int]:
    """The poses gone through once, and how often they are."""
    names = [pose.name for pose in poses]
    times = names.count(names[0]) if names else 1
    once = poses[: len(poses) // times]
    return (once, times) if poses == once * times else (poses, 1)


def limits_from(limits: str, home: Path, folder: Path) -> str:
    """A recipe's limits as a recipe in another folder names them: built-in ones by name, a file by its way from there."""
    beside = home / limits
    return os.path.relpath(beside, folder) if beside.is_file() else limits


def _value(value: object) -> str:
    """A value as TOML writes it: JSON does for texts, numbers, yes and no, and lists of them."""
    return json.dumps(value, ensure_ascii=False)


def _angles(poses: Iterable[Pose]) -> list[str]:
    return [f"[{pose.outer_deg}, {pose.inner_deg}]" for pose in poses]


def _listed(key: str, items: list[str]) -> list[str]:
    """``key = [...]``, broken into lines where it is long."""
    whole = f"{key} = [{', '.join(items)}]"
    if len(whole) <= WIDTH:
        return [whole]
    lines, line = [f"{key} = ["], "   "
    for item in items:
        if len(line) + len(item) + 2 > WIDTH:
            lines.append(line)
            line = "   "
        line += f" {item},"
    return [*lines, line, "]"]
