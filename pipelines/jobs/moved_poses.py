"""A recipe with some of its poses turned elsewhere: ``NAME=OUTER,INNER`` in degrees."""

import math
from collections.abc import Iterable

from pydantic import ValidationError

from pipelines.jobs.recipes import refuse_unusable_poses
from schemas.errors import WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.toml_files import explain

Angles = tuple[float, float]
FULL_TURN = 360.0


def moves_of(texts: Iterable[str], where: str) -> dict[str, Angles]:
    """Outer and inner angle in degrees by the name of the pose; of two for one pose the last counts.

    texts : each ``NAME=OUTER,INNER``, such as ``p05=45,-90`` · where : first words of the message

    Raises WrongUse: a text is not of this form, or an angle is beyond a turn.
    """
    moves: dict[str, Angles] = {}
    for text in texts:
        name, _, angles = text.partition("=")
        try:
            outer, inner = (float(part) for part in angles.split(","))
        except ValueError:
            raise WrongUse(
                f"{where}: pose '{shown(text, 60)}', a name and two angles in degrees are needed; write one such as p05=45,-90"
            ) from None
        if not (math.isfinite(outer) and math.isfinite(inner) and max(abs(outer), abs(inner)) <= FULL_TURN):
            raise WrongUse(
                f"{where}: pose {shown(name.strip(), 40)} at {outer:g}°, {inner:g}°, angles within ± {FULL_TURN:g}° are needed; "
                "correct them"
            )
        moves[name.strip()] = (outer, inner)
    return moves


def with_moved_poses(recipe: Recipe, moves: dict[str, Angles], where: str) -> Recipe:
    """The recipe with the poses of these names at other angles; checked as a recipe file is.

    Raises WrongUse: the recipe has no pose of a name.
    Raises RecipeInvalid: the poses are useless for a fit, or a pose for verification coincides with a pose of the fit.
    """
    if not moves:
        return recipe
    known = list(dict.fromkeys(pose.name for pose in (*recipe.poses, *recipe.verification)))
    unknown = next((name for name in moves if name not in known), None)
    if unknown is not None:
        raise WrongUse(
            f"{where}: recipe {recipe.name} has no pose '{shown(unknown, 40)}'; {did_you_mean(unknown, known)}"
        )

    def moved(pose: Pose) -> dict[str, object]:
        outer, inner = moves.get(pose.name, (pose.outer_deg, pose.inner_deg))
        return {"name": pose.name, "outer_deg": outer, "inner_deg": inner}

    changed = {"poses": [moved(p) for p in recipe.poses], "verification": [moved(p) for p in recipe.verification]}
    source = f"recipe {recipe.name}"
    try:
        moved_recipe = Recipe.model_validate({**recipe.model_dump(), **changed})
    except ValidationError as problem:
        raise explain(problem, source, Recipe) from None
    refuse_unusable_poses(moved_recipe, moved_recipe.poses, moved_recipe.verification, source)
    return moved_recipe
