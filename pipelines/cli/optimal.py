"""``tumbleline plan optimise``: the search, the recipe file, and the printed result."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

from inertial.arrays import Array
from inertial.design import local_names, split
from inertial.noise.dwells import DwellNoise
from inertial.planning.pose_exchange import Criterion
from inertial.poses import NAMED
from pipelines.cli.options import names_in
from pipelines.cli.printing import error_console
from pipelines.jobs.model_files import refuse_unknown_effects
from pipelines.jobs.recipe_text import limits_from, recipe_text
from pipelines.jobs.recipes import load_limits
from pipelines.planning.context import PlanContext, plan_context
from pipelines.planning.discrimination import ENOUGH, SIZE_UG, discrimination_requirement
from pipelines.planning.optimise import Optimum, optimise
from pipelines.planning.optimum_document import optimum_document
from pipelines.planning.requirement import Requirement, candidates, temperature_choices, verified_in
from pipelines.planning.textbook import reference_errors, seen_by, textbook
from schemas.bounds import COLDEST_C, HOTTEST_C
from schemas.errors import TumblelineError, WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.units import MICRO


@dataclass(frozen=True)
class OptimiseOptions:
    """The options of the command."""

    see: str
    required_errors: Sequence[str]
    criterion: str
    part: str
    factor: float = 1.0
    temperatures: str = ""
    poses: str = ""
    size: float | None = None
    separation: float | None = None
    verification: int | None = None
    ramp: bool = False


def levels_of(base: Recipe, temperatures: str) -> tuple[float, ...]:
    """Required temperatures, °C, in rising order."""
    try:
        given = [float(part) for part in temperatures.split(",")] if temperatures else base.temperatures_C
    except ValueError:
        raise WrongUse(
            f"plan: --set temperatures='{temperatures}' is no list of numbers, one is needed; write -10,25,60"
        ) from None
    outside = [level for level in given if not COLDEST_C <= level <= HOTTEST_C]
    if outside:
        found, needed = f"found {outside[0]:g} °C", f"{COLDEST_C:g} to {HOTTEST_C:g} °C is needed"
        raise WrongUse(f"plan: --set temperatures='{temperatures}': {found}, {needed}; correct it")
    return tuple(sorted(set(given)))


def _discriminates(options: OptimiseOptions) -> bool:
    """Whether the options require discrimination; options that do not go together are refused."""
    parts = options.criterion.upper() == "T"
    if not parts and options.part:
        raise WrongUse(
            f"plan: --criterion {options.criterion}:{options.part}: found '{options.criterion}' before the colon, T is needed to "
            "discriminate between effects; write --criterion T:a,b, or worst, A or D without a colon"
        )
    other = (
        {"--wanted EFFECT=µg": options.required_errors, "--set factor": options.factor != 1.0}
        if parts
        else {
            "--set size": options.size is not None,
            "--set separation": options.separation is not None,
        }
    )
    for option, given in other.items():
        if given:
            raise WrongUse(
                f"plan: {option} does not go with --criterion {options.criterion}; leave one of the two out"
                + ("" if parts else ", or write --criterion T:a,b")
            )
    return parts


def _discrimination(options: OptimiseOptions, against: PlanContext, levels: tuple[float, ...]) -> Requirement:
    rivals, see = names_in(options.part), names_in(options.see)
    if not rivals:
        raise WrongUse(
            "plan: --criterion T needs the effects to discriminate between; write --criterion T:third_order,odd_quadratic"
        )
    refuse_unknown_effects(rivals, "plan: --criterion T")
    refuse_unknown_effects(see, "plan: --wanted")
    _refuse_unknown_plan(options.poses)
    size, enough = options.size or SIZE_UG, options.separation or ENOUGH
    return discrimination_requirement(against, rivals, levels, size_ug=size, enough=enough, plan=options.poses, see=see)


def _refuse_unknown_plan(name: str) -> None:
    if name and name not in NAMED:
        raise WrongUse(f"plan: no plan of poses is called '{shown(name)}'; {did_you_mean(name, list(NAMED))}")


def _required_errors(
    options: OptimiseOptions, base: Recipe, against: PlanContext, levels: tuple[float, ...]
) -> Requirement:
    criteria = {name.lower(): name for name in get_args(Criterion)}
    if options.criterion.lower() not in criteria:
        known = [*get_args(Criterion), "T"]
        raise WrongUse(f"plan: no criterion '{options.criterion}'; {did_you_mean(options.criterion, known)}")
    _refuse_unknown_plan(options.poses)
    see = names_in(options.see)
    refuse_unknown_effects(see, "plan: --wanted")
    errors = options.factor * reference_errors(against, base)
    names = [name for name, _ in local_names(split(base.effects)[0], 0)]
    for effect, limit in _limits(options.required_errors, names).items():
        for column, name in enumerate(names):
            if name == effect:
                errors[:, column] = limit / MICRO
    return Requirement(
        errors=errors,
        see=see or seen_by(against, levels),
        levels=levels if options.temperatures else (levels[0], levels[-1]),
        optional_levels=() if options.temperatures else temperature_choices(levels),
        candidates=candidates(against.station, options.poses),
        criterion=criteria[options.criterion.lower()],
    )


def _limits(required_errors: Sequence[str], model: list[str]) -> dict[str, float]:
    """Required errors by effect, µg per unit of the column."""
    limits: dict[str, float] = {}
    for text in required_errors:
        effect, _, number = text.partition("=")
        try:
            limits[effect] = float(number)
        except ValueError:
            limits[effect] = 0.0
        if effect not in model:
            raise WrongUse(f"plan: --wanted '{text}': '{effect}' is not in the model; {did_you_mean(effect, model)}")
        if not limits[effect] > 0.0:
            raise WrongUse(f"plan: --wanted '{text}': a positive error in µg is needed; write {effect}=50")
    return limits


TOLERANCE = 1.1
"""Largest ratio to the textbook plan's errors for which the nearest recipe is written, without required errors in the options."""


def cheapest_recipe(
    base: Recipe,
    name: str,
    station: StationConfig,
    noise: DwellNoise,
    options: OptimiseOptions,
    prior: Array | None = None,
) -> tuple[Optimum, dict[str, Any]]:
    """The recipe with the least station time for the required errors, and the document about it.

    name : of the recipe to start from on the command line
    prior : (m, p, p), precision of a prior of the coefficients, 1/g²
    """
    levels = levels_of(base, options.temperatures)
    against = plan_context(textbook(base, levels), station, noise)
    requirement = (
        _discrimination(options, against, levels)
        if _discriminates(options)
        else _required_errors(options, base, against, levels)
    )
    requirement = replace(requirement, verification=options.verification or verified_in(base), prior=prior)
    errors_named = bool(options.required_errors) or options.factor != 1.0
    tolerance = 1.0 if errors_named else TOLERANCE
    with error_console().status("searching for the recipe with the least station time") as status:
        best = optimise(
            base,
            against,
            requirement,
            lambda note: status.update(f"searching: {note}"),
            tolerance=tolerance,
            ramp=options.ramp,
        )
    return best, optimum_document(best, base, name)


def written(best: Optimum, target: Path, home: Path, document: dict[str, Any]) -> str:
    """The text of the recipe file at ``target``.

    home : folder of the recipe that the search started from
    """
    recipe = best.planned.recipe
    limits = limits_from(recipe.limits, home, target.parent)
    remarks = [
        f"Written by 'tumbleline plan optimise' for station {best.planned.station.name}.",
        (
            f"Station time: {document['minutes']['total']:.0f} min; {document['from']}: "
            f"{document['own_minutes']['total']:.0f} min; textbook plan: {document['textbook_minutes']['total']:.0f} min."
        ),
        f"{_reached(best)}.",
    ]
    return recipe_text(recipe.model_copy(update={"limits": limits}), remarks)


def missing_limits(recipe: Recipe, home: Path) -> str:
    """A warning where the limits of a recipe cannot be read from its folder; else empty."""
    try:
        load_limits(recipe, home)
    except TumblelineError as problem:
        return f"{problem}; 'tumbleline run' refuses the new recipe until its limits exist"
    return ""


def _reached(best: Optimum) -> str:
    if best.requirement.discrimination is None:
        return f"Expected errors: at most {best.worst:.2f} of the required ones"
    rivals = best.requirement.effects[-len(best.requirement.discrimination.rivals) :]
    chi_square = best.requirement.discrimination.chi_square / best.worst**2
    return f"Discrimination between {', '.join(rivals)}: χ² at least {chi_square:.0f}"
