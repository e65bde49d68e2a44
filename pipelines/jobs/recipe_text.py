"""A resolved recipe as the text of a recipe file: the fields of the file's own model, written by a TOML library."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Array, Item, Table

from schemas.errors import WrongUse
from schemas.poses import Pose
from schemas.recipe import Recipe, RecipeFile

WIDTH = 100
RESOLVED = {"poses", "verification", "static_pose", "model_name", "model_version", "formulas"}
"""Fields of a resolved recipe that stand otherwise in a file."""


def recipe_text(recipe: Recipe, remarks: Iterable[str] = ()) -> str:
    """The text of a recipe file that reads as this recipe; keys that stand at their defaults are left out.

    remarks : lines for the head of the file, without the sign of a remark

    Raises WrongUse: the model has formulas, which only a model file can hold.
    """
    if recipe.formulas:
        raise WrongUse(
            f"recipe {recipe.name}: its model has the formula '{recipe.formulas[0].id}', a recipe file holds effects of the "
            "catalogue only; give the effects with --effects, and name the model file in the recipe that is written"
        )
    document = tomlkit.document()
    for line in (line for remark in remarks for line in remark.splitlines()):
        document.add(tomlkit.comment(line))
    written = recipe_file(recipe).model_dump(exclude_defaults=True, exclude_none=True)
    tables = {key for key, value in written.items() if isinstance(value, list) and value and isinstance(value[0], dict)}
    if "soaks" in tables:
        written.pop("temperatures_C", None)  # the soaks say them
    tables |= {key for key, value in written.items() if isinstance(value, dict)}
    # a key behind a table would belong to the table
    for key in sorted(written, key=lambda key: key in tables):
        if key == "poses":
            document.add(tomlkit.comment("poses: outer, inner in degrees; the numbers in soaks count them from 1"))
        document.add(key, _item(key, written[key]))
    return tomlkit.dumps(document)


def recipe_file(recipe: Recipe) -> RecipeFile:
    """The recipe as the content of a file: poses by their angles, repeated verification poses once."""
    once, times = _repeated(recipe.verification)
    return RecipeFile(
        **recipe.model_dump(exclude=RESOLVED),
        poses=[_angles(pose) for pose in recipe.poses],
        verification=[_angles(pose) for pose in once],
        verification_repeats=times,
        static_pose=_angles(recipe.static_pose),
    )


def _repeated(poses: list[Pose]) -> tuple[list[Pose], int]:
    """The poses gone through once, and how often they are."""
    names = [pose.name for pose in poses]
    times = names.count(names[0]) if names else 1
    once = poses[: len(poses) // times]
    return (once, times) if poses == once * times else (poses, 1)


def _angles(pose: Pose) -> list[float]:
    return [pose.outer_deg, pose.inner_deg]


def limits_from(limits: str, home: Path, folder: Path) -> str:
    """A recipe's limits as a recipe in another folder names them: built-in limits by name, a file by its path from there."""
    beside = home / limits
    return os.path.relpath(beside, folder) if beside.is_file() else limits


def _item(key: str, value: Any) -> Item:
    """A value as an item of the document; lists that are too long for a line stand one entry a line."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        several = tomlkit.aot()
        for row in value:
            several.append(_table(row))
        return several
    if isinstance(value, dict):
        return _table(value)
    item = tomlkit.item(value)
    if isinstance(item, Array) and len(f"{key} = {item.as_string()}") > WIDTH:
        item.multiline(multiline=True)
    return item


def _table(content: dict[str, Any]) -> Table:
    table = tomlkit.table()
    for key in sorted(content, key=lambda key: isinstance(content[key], dict)):
        table.add(key, _item(key, content[key]))
    return table
