"""Recipes and limits by file or built-in name, with every name in them resolved and every pose checked.

Nothing here touches a station: what cannot work is refused before anything moves.
"""

from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from inertial import poses
from inertial.frames import force_from_angles
from pipelines.jobs.model_files import model_keys, read_model, refuse_unknown_effects
from schemas.errors import RecipeInvalid, WrongUse, close_matches, did_you_mean
from schemas.foreign import is_file, shown
from schemas.limits import Limits, parse_limits, unknown_limits
from schemas.lot import Lot, Unit
from schemas.own_files import own_file, own_files, refuse_built_in_name
from schemas.poses import Pose
from schemas.recipe import Recipe, RecipeFile
from schemas.serials import refuse_unusable_serials
from schemas.shipped import hint_of_sample
from schemas.toml_files import explain, parse_as, read_text
from schemas.units import AXES

MAIN_JOB = "production"
SAME_POSE_DEG = 1.0
LINE = "line"  # what a recipe says in place of a model file for the model that is released to the line
LineModel = Callable[[str], dict[str, Any]]


def load_recipe(name: str = MAIN_JOB, line: LineModel | None = None) -> Recipe:
    """The recipe of a file, or the built-in one of this name, resolved and checked.

    line : the keys that say the line's model for a kind of device; refused where a recipe asks for it and it is None
    """
    text, source, folder = _recipe_text(name)
    return resolved(parse_as(RecipeFile, text, source), source, folder, line)


def resolved(file: RecipeFile, source: str, folder: Path | None = None, line: LineModel | None = None) -> Recipe:
    """The content of a recipe file with every name in it resolved, and its poses checked.

    source : what messages call the file
    folder : that names of model files are relative to; the working folder where None
    line : see :func:`load_recipe`

    Raises RecipeInvalid: a name is not known, or the poses cannot work.
    """
    model = _model(file, folder or Path(), source, line)
    fit_poses = _resolve(file.poses, "p", "poses", source)
    verification = _resolve(file.verification, "v", "verification", source)
    refuse_unusable_poses(file, fit_poses, verification, source)
    shared = file.model_dump(
        exclude={"poses", "verification", "verification_repeats", "static_pose", "model", "effects"}
    )
    outer, inner = file.static_pose
    try:
        return Recipe(
            **shared,
            **model,
            poses=fit_poses,
            verification=verification * file.verification_repeats,
            static_pose=Pose(name="static", outer_deg=outer, inner_deg=inner),
        )
    except ValidationError as problem:
        raise explain(problem, source, RecipeFile) from None


def refuse_unusable_poses(
    recipe: Recipe | RecipeFile, fit: Sequence[Pose], verification: Sequence[Pose], source: str
) -> None:
    """Refuse poses that span too little for a fit, and verification in a direction of the fit.

    Raises RecipeInvalid: the axis or the poses, and what is needed.
    """
    if recipe.tumbles:
        _refuse_flat_plan(fit, recipe.span_min_g, recipe.sensor_axes)
        _refuse_coincidence(fit, verification, source)


def units_of(name: str = MAIN_JOB) -> list[str]:
    """The units that a recipe names, whatever its model is."""
    text, source, _ = _recipe_text(name)
    return parse_as(RecipeFile, text, source).units


def folder_of(name: str) -> Path:
    """The folder that names of files in a recipe are relative to; the working folder for a built-in one."""
    return _recipe_text(name)[2]


def load_limits(recipe: Recipe, folder: Path | None = None) -> Limits:
    """The limits that a recipe names: a file beside the recipe or anywhere, or built-in limits."""
    return read_limits(recipe.limits, folder)


def read_limits(name: str, folder: Path | None = None) -> Limits:
    """The limits of a file in a folder or anywhere, of the user, or the built-in limits of this name."""
    from pipelines.stages.figures import UNITS

    known = sample_names("limits-")
    paths = (path for path in ((folder or Path()) / name, Path(name)) if is_file(path))
    path = next(paths, None)
    if path is not None:
        refuse_built_in_name("limits", name, path, known)
    path = path or own_file("limits", name, known)
    if path is not None:
        return _judged_rightly(parse_limits(read_text(path, "limits"), f"limits {path.name}", UNITS), path.name)
    built_in = files("schemas") / "samples" / f"limits-{name}.toml"
    if name not in known:
        raise unknown_limits(name, [*known, *own_files("limits")])
    return parse_limits(built_in.read_text(encoding="utf-8"), f"limits {name}", UNITS)


def _judged_rightly(limits: Limits, name: str) -> Limits:
    """The limits; a least value of a figure of which only the largest axis is stated would be judged on the best axis."""
    from pipelines.procedures import FIGURES

    for figure, limit in limits.figures.items():
        spec = FIGURES.get(figure)
        if limit.min is not None and spec is not None and not spec.one_axis:
            raise RecipeInvalid(
                f"limits {name}: {figure}: min is given, max is needed: of this figure the largest of the axes is judged",
                key=f"figures.{figure}.min",
            )
    return limits


def lot_of(
    recipe: Recipe, serials: Sequence[str], slots: Sequence[int] = (), *, seed: int | None = None, repeat: int = 0
) -> Lot:
    """The lot to measure: the serials given, or else the recipe's, each in its slot, or in slots from 0 on."""
    named = list(serials) or recipe.units
    if not named:
        raise WrongUse(
            "lot: no unit is named, at least one is needed; give serial numbers with --units, or in the recipe"
        )
    refuse_unusable_serials(named, "lot", "correct it", WrongUse)
    twice = sorted({serial for serial in named if named.count(serial) > 1})
    if twice:
        raise WrongUse(
            f"lot: serial {', '.join(twice)} is there twice, each may be there once; correct the list of units"
        )
    alike = [serial for serial in named if [other.lower() for other in named].count(serial.lower()) > 1]
    if alike:
        raise WrongUse(
            f"lot: serials {' and '.join(alike)} differ in capitals alone, some disks keep one file for both; give one another"
        )
    units = [Unit(serial=serial, slot=slot) for serial, slot in zip(named, slots or range(len(named)), strict=True)]
    try:
        chosen, axes = recipe.seed if seed is None else seed, recipe.sensor_axes
        return Lot(units=units, device=recipe.device, sensor_axes=axes, seed=chosen, repeat=repeat)
    except ValidationError as problem:
        raise explain(problem, "lot", Lot) from None


def sample_names(prefix: str = "") -> list[str]:
    """Names of the built-in recipes (no prefix) or limits (prefix ``limits-``)."""
    stems = [item.name.removesuffix(".toml") for item in (files("schemas") / "samples").iterdir()]
    if prefix:
        return sorted(stem.removeprefix(prefix) for stem in stems if stem.startswith(prefix))
    return sorted(stem for stem in stems if not stem.startswith("limits-"))


def recipe_names() -> list[str]:
    """Names of the built-in recipes and of the user's."""
    return sorted({*sample_names(), *own_files("recipes")})


def limits_names() -> list[str]:
    """Names of the built-in limits and of the user's."""
    return sorted({*sample_names("limits-"), *own_files("limits")})


def _recipe_text(name: str) -> tuple[str, str, Path]:
    """Content, what to call it in messages, and the folder that names inside it are relative to."""
    built_in = sample_names()
    path = Path(name) if is_file(name) else own_file("recipes", name, built_in)
    if path is not None:
        refuse_built_in_name("recipes", name, path, built_in)
        return read_text(path, "recipe"), f"recipe {path.name}", path.parent
    if name in built_in:
        text = (files("schemas") / "samples" / f"{name}.toml").read_text(encoding="utf-8")
        return text, f"recipe {name}", Path()
    known = recipe_names()
    raise RecipeInvalid(
        f"recipe: no file and no recipe is called '{shown(name)}'; {did_you_mean(name, known)}{hint_of_sample('recipe', name)}",
        close=close_matches(name, known),
    )


def _model(file: RecipeFile, folder: Path, source: str, line: LineModel | None) -> dict[str, Any]:
    """Effects, formulas, name and version of the model; name and version are empty for a list of effects."""
    if file.model == LINE:
        if line is None:
            raise RecipeInvalid(
                f"{source}: key 'model': '{LINE}' is the model that is released in an archive, which this command does not ask; "
                "name a model file or effects",
                key="model",
            )
        return line(file.device)
    if not file.model:
        refuse_unknown_effects(file.effects, f"{source}: key 'effects'")
        return {"effects": file.effects}
    return model_keys(read_model(folder / file.model))


def _resolve(given: str | Sequence[Sequence[float]], letter: str, key: str, source: str) -> list[Pose]:
    if isinstance(given, str):
        if given not in poses.NAMED:
            known = list(poses.NAMED)
            raise RecipeInvalid(
                f"{source}: key '{key}': no plan is called '{shown(given)}'; {did_you_mean(given, known)}",
                key=key,
                close=close_matches(given, known),
            )
        given = poses.plan(given).tolist()
    pairs = [(float(outer), float(inner)) for outer, inner in given]
    width = len(str(len(pairs)))
    return [
        Pose(name=f"{letter}{number:0{width}d}", outer_deg=outer, inner_deg=inner)
        for number, (outer, inner) in enumerate(pairs, start=1)
    ]


def directions(chosen: Sequence[Pose]) -> NDArray[np.float64]:
    """Directions of gravity in the fixture, (n, 3), of some poses."""
    angles = np.radians([(pose.outer_deg, pose.inner_deg) for pose in chosen])
    return force_from_angles(angles[:, 0], angles[:, 1])


def _refuse_flat_plan(chosen: Sequence[Pose], needed_g: float, axes: int) -> None:
    spans = np.ptp(directions(chosen), axis=0)[:axes]
    worst = int(np.argmin(spans))
    if spans[worst] < needed_g:
        axis = AXES[worst]
        raise RecipeInvalid(
            f"fit: poses span {spans[worst]:.2f} g on {axis}, the recipe needs {needed_g:g} g; "
            f"add poses with {axis} up and {axis} down",
            key="poses",
        )


def _refuse_coincidence(fit: Sequence[Pose], verification: Sequence[Pose], source: str) -> None:
    """Refuse verification in a direction that the fit has seen: it would verify nothing."""
    if not verification:
        return
    cosines = np.clip(directions(verification) @ directions(fit).T, -1.0, 1.0)
    apart = np.degrees(np.arccos(cosines))
    row, column = divmod(int(np.argmin(apart)), apart.shape[1])
    if apart[row, column] < SAME_POSE_DEG:
        raise RecipeInvalid(
            f"{source}: key 'verification': pose {verification[row].name} lies {apart[row, column]:.2f}° from pose "
            f"{fit[column].name} of the fit, at least {SAME_POSE_DEG:g}° is needed; choose directions between the fit's",
            key="verification",
        )
