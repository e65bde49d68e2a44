"""The options of ``tumbleline plan optimise``, and the requirement that they state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

from schemas.bounds import COLDEST_C, HOTTEST_C
from schemas.errors import WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.recipe import Recipe
from schemas.units import MICRO

if TYPE_CHECKING:
    from pipelines.planning.context import PlanContext
    from pipelines.planning.requirement import Requirement


@dataclass(frozen=True)
class OptimiseOptions:
    """The options of the command."""

    see: str
    required_errors: tuple[str, ...]
    factor: float
    temperatures: str
    poses: str
    criterion: str
    verification: int | None = None
    part: str = ""
    size: float | None = None
    separation: float | None = None
    ramp: bool = False

    @property
    def errors_named(self) -> bool:
        """Whether required errors were given, in place of the textbook plan's."""
        return bool(self.required_errors) or self.factor != 1.0


def requirement_of(
    options: OptimiseOptions, base: Recipe, against: PlanContext, levels: tuple[float, ...]
) -> Requirement:
    """The requirement of the options: errors, or discrimination between rivals."""
    return (
        _discrimination(options, against, levels)
        if _discriminates(options)
        else _required_errors(options, base, against, levels)
    )


def levels_of(base: Recipe, temperatures: str) -> tuple[float, ...]:
    """Required temperatures, °C, in rising order."""
    try:
        given = [float(part) for part in temperatures.split(",")] if temperatures else base.temperatures_C
    except ValueError:
        raise WrongUse(
            f"plan: --temperatures '{temperatures}' is no list of numbers, one is needed; write -10,25,60"
        ) from None
    outside = [level for level in given if not COLDEST_C <= level <= HOTTEST_C]
    if outside:
        found, needed = f"found {outside[0]:g} °C", f"{COLDEST_C:g} to {HOTTEST_C:g} °C is needed"
        raise WrongUse(f"plan: --temperatures '{temperatures}': {found}, {needed}; correct it")
    return tuple(sorted(set(given)))


def _discriminates(options: OptimiseOptions) -> bool:
    """Whether the options require discrimination; options that do not go together are refused."""
    parts = options.criterion.upper() == "T"
    other = (
        {"--wanted": options.required_errors, "--factor": options.factor != 1.0}
        if parts
        else {
            "--part": options.part,
            "--size": options.size is not None,
            "--separation": options.separation is not None,
        }
    )
    for option, given in other.items():
        if given:
            raise WrongUse(
                f"plan: {option} does not go with --criterion {options.criterion}; leave one of the two out"
                + ("" if parts else ", or write --criterion T")
            )
    return parts


def _discrimination(options: OptimiseOptions, against: PlanContext, levels: tuple[float, ...]) -> Requirement:
    from pipelines.jobs.model_files import refuse_unknown_effects
    from pipelines.planning.discrimination import ENOUGH, SIZE_UG, discrimination_requirement

    rivals, see = _names(options.part), _names(options.see)
    if not rivals:
        raise WrongUse(
            "plan: --criterion T needs the effects to discriminate between; write --part third_order,odd_quadratic"
        )
    refuse_unknown_effects(rivals, "plan: --part")
    refuse_unknown_effects(see, "plan: --see")
    _refuse_unknown_plan(options.poses)
    return discrimination_requirement(
        against,
        rivals,
        levels,
        size_ug=options.size or SIZE_UG,
        enough=options.separation or ENOUGH,
        plan=options.poses,
        see=see,
    )


def _names(listed: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(part.strip() for part in listed.split(",") if part.strip()))


def _refuse_unknown_plan(name: str) -> None:
    from inertial.poses import NAMED

    if name and name not in NAMED:
        raise WrongUse(f"plan: no plan of poses is called '{shown(name)}'; {did_you_mean(name, list(NAMED))}")


def _required_errors(
    options: OptimiseOptions, base: Recipe, against: PlanContext, levels: tuple[float, ...]
) -> Requirement:
    from inertial.design import local_names, split
    from inertial.planning.pose_exchange import Criterion
    from pipelines.jobs.model_files import refuse_unknown_effects
    from pipelines.planning.requirement import Requirement, candidates, temperature_choices
    from pipelines.planning.textbook import reference_errors, seen_by

    criteria = {name.lower(): name for name in get_args(Criterion)}
    if options.criterion.lower() not in criteria:
        known = [*get_args(Criterion), "T"]
        raise WrongUse(f"plan: no criterion '{options.criterion}'; {did_you_mean(options.criterion, known)}")
    _refuse_unknown_plan(options.poses)
    see = _names(options.see)
    refuse_unknown_effects(see, "plan: --see")
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


def _limits(required_errors: tuple[str, ...], model: list[str]) -> dict[str, float]:
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
