"""What ``tumbleline plan optimise`` finds, writes and prints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, get_args

from pipelines.cli.options import console, error_console, print_table, short
from schemas.bounds import COLDEST_C, HOTTEST_C
from schemas.errors import WrongUse, did_you_mean
from schemas.units import MICRO

if TYPE_CHECKING:
    from pathlib import Path

    from inertial.noise.dwells import DwellNoise
    from pipelines.planning.optimise import Optimum
    from pipelines.planning.plan import PlanContext
    from pipelines.planning.requirement import Requirement
    from schemas.recipe import Recipe
    from schemas.station import StationConfig

TOLERANCE = 1.1
"""Errors over the textbook plan's up to which the nearest recipe is offered where nobody said what errors are wanted."""


def found(
    base: Recipe, station: StationConfig, noise: DwellNoise, options: OptimiseOptions
) -> tuple[Optimum, dict[str, Any]]:
    """The cheapest recipe, and the document about it."""
    from pipelines.planning.optimise import optimise
    from pipelines.planning.plan import plan, plan_context
    from pipelines.planning.textbook import textbook
    from pipelines.planning.verification_poses import verified_in

    levels = levels_of(base, options.temperatures)
    against = plan_context(textbook(base, levels), station, noise)
    requirement = requirement_of(options, base, against, levels)
    requirement = replace(requirement, verification=options.verification or verified_in(base))
    progress = error_console()
    with progress.status("looking for the cheapest recipe") as status:
        tolerance = 1.0 if options.errors_named else TOLERANCE
        best = optimise(base, against, requirement, lambda note: status.update(f"looking: {note}"), tolerance=tolerance)
    return best, document(best, plan(best.planned))


def document(best: Optimum, plan: dict[str, Any]) -> dict[str, Any]:
    """What was found, for programs."""
    from inertial.planning.visibility import visibilities
    from pipelines.planning.discrimination import rival_separations
    from pipelines.schedule.timing import spent

    textbook = best.against
    seen = {s.effect for s in visibilities(textbook.state, textbook.recipe.effects, 1.0) if s.seen}
    there = {(row["true"], row["wrong"]): row["chi_square"] for row in rival_separations(best.requirement, textbook)}
    rivals = [
        {**r, "textbook": there[r["true"], r["wrong"]]} for r in rival_separations(best.requirement, best.planned)
    ]
    return {
        "recipe": plan["recipe"],
        "dwell_s": plan["dwell_s"]["planned"],
        "temperatures_C": plan["temperatures_C"],
        "poses": plan["poses"],
        "dwells": plan["dwells"],
        "minutes": plan["minutes"],
        "textbook_minutes": spent(textbook.activities).document(),
        "share": best.share,
        "verification_dwells": _verification(best.planned.recipe),
        "worst": best.worst,
        "coefficients": _wanted_rows(best, plan),
        "rivals": rivals,
        "seen_besides": sorted({row["effect"] for row in plan["effects"] if row["seen"]} - seen),
        "plan": plan,
    }


def _wanted_rows(best: Optimum, plan: dict[str, Any]) -> list[dict[str, Any]]:
    """The coefficients with what was wanted of them; nothing was, where rivals were to be told apart."""
    place = {"x": 0, "y": 1, "z": 2}
    columns: dict[str, int] = {}
    rows: list[dict[str, Any]] = []
    for row in plan["coefficients"]:
        if row["axis"] in place:
            column = columns.setdefault(row["axis"], 0)
            columns[row["axis"]] += 1
            limit = (
                MICRO * float(best.requirement.errors[place[row["axis"]], column])
                if best.requirement.discrimination is None
                else None
            )
            rows.append({**row, "wanted_ug": limit})
    return rows


def _verification(recipe: Recipe) -> int:
    return sum(len(recipe.verification_at(k)) for k in range(len(recipe.temperatures_C)))


def written(best: Optimum, target: Path, home: Path) -> str:
    """The text of the recipe's file at ``target``; ``home`` is the folder of the recipe that it began from."""
    from pipelines.jobs.recipe_text import limits_from, recipe_text
    from pipelines.schedule.timing import spent

    recipe = best.planned.recipe
    limits = limits_from(recipe.limits, home, target.parent)
    minutes, textbook = (spent(p.activities).total for p in (best.planned, best.against))
    remarks = [
        f"Found by 'tumbleline plan optimise': {minutes:.0f} min on station {best.planned.station.name}, where the textbook plan",
        f"needs {textbook:.0f} min; {_reached(best)}.",
    ]
    return recipe_text(recipe.model_copy(update={"limits": limits}), remarks)


def _reached(best: Optimum) -> str:
    if best.requirement.discrimination is None:
        return f"no coefficient's error is above {best.worst:.2f} of what was wanted"
    rivals = best.requirement.effects[-len(best.requirement.discrimination.rivals) :]
    return f"it tells {', '.join(rivals)} apart, χ² {best.requirement.discrimination.chi_square / best.worst**2:.0f} at least"


def print_optimum(document: dict[str, Any]) -> None:
    """The recipe found, for people."""
    out, minutes, textbook = console(), document["minutes"], document["textbook_minutes"]
    heat = ", ".join(f"{t:g}" for t in document["temperatures_C"])
    out.print(
        f"{document['recipe']}: {document['dwells']} dwells of {document['dwell_s']:g} s "
        f"in {document['poses']} poses, soaks at {heat} °C"
    )
    parts = [[name.replace("_", " "), f"{minutes[name]:.0f}", f"{textbook[name]:.0f}"] for name in minutes]
    print_table(["station time, min", "this recipe", "textbook plan"], parts)
    out.print(
        f"{100.0 * document['share']:.0f} % of the textbook plan's time, the static record apart; "
        f"{document['verification_dwells']} dwells are for verification, of which the textbook plan has none",
        soft_wrap=True,
    )
    if document["worst"] > 1.0:
        out.print(
            "No recipe was found that reaches the textbook plan's errors everywhere; this one comes nearest, with "
            f"{document['worst']:.3f} of them at most. --factor asks for larger errors, --verification for fewer dwells.",
            soft_wrap=True,
        )
    if document["rivals"]:
        lines = [[r["true"], r["wrong"], short(r["chi_square"]), short(r["textbook"])] for r in document["rivals"]]
        print_table(["if true", "taken for", "χ² in the lot", "textbook plan"], lines, whole=2)
    else:
        print_table(["coefficient", "error 1σ", "wanted", "over", "unit"], _error_lines(document["coefficients"]))
    if document["seen_besides"]:
        out.print(f"Sees besides, for nothing: {', '.join(document['seen_besides'])}")
    out.print(f"Written to {document['file']}; measure with 'tumbleline run {document['file']}'")
    if "page" in document:
        out.print(f"page: {document['page']}")


def _error_lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    return [
        [
            f"{r['effect']} {r['name']}",
            short(r["uncertainty_ug"]),
            short(r["wanted_ug"]),
            f"{r['uncertainty_ug'] / r['wanted_ug']:.2f}",
            r["unit"],
        ]
        for r in rows
    ]


@dataclass(frozen=True)
class OptimiseOptions:
    """The options of the command, as they were given."""

    see: str
    wanted: tuple[str, ...]
    factor: float
    temperatures: str
    poses: str
    criterion: str
    verification: int | None = None
    part: str = ""
    size: float | None = None
    separation: float | None = None

    @property
    def errors_named(self) -> bool:
        """Whether the errors wanted were given, rather than left at the textbook plan's."""
        return bool(self.wanted) or self.factor != 1.0


def requirement_of(
    options: OptimiseOptions, base: Recipe, against: PlanContext, levels: tuple[float, ...]
) -> Requirement:
    """The requirement of what was options: errors as wanted, or rivals told apart."""
    return (
        _discrimination(options, against, levels)
        if _discriminates(options)
        else _required_errors(options, base, against, levels)
    )


def levels_of(base: Recipe, temperatures: str) -> tuple[float, ...]:
    """Temperatures to meet, from the lowest."""
    try:
        given = [float(part) for part in temperatures.split(",")] if temperatures else base.temperatures_C
    except ValueError:
        raise WrongUse(f"plan: --temperatures '{temperatures}' is no list of numbers; write -10,25,60") from None
    outside = [level for level in given if not COLDEST_C <= level <= HOTTEST_C]
    if outside:
        found, needed = f"found {outside[0]:g} °C", f"{COLDEST_C:g} to {HOTTEST_C:g} °C is needed"
        raise WrongUse(f"plan: --temperatures '{temperatures}': {found}, {needed}; correct it")
    return tuple(sorted(set(given)))


def _discriminates(options: OptimiseOptions) -> bool:
    """Whether rivals are to be told apart; options of the one question beside the other are refused."""
    parts = options.criterion.upper() == "T"
    other = (
        {"--wanted": options.wanted, "--factor": options.factor != 1.0}
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
        raise WrongUse("plan: --criterion T needs the effects to tell apart; write --part third_order,odd_quadratic")
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
        raise WrongUse(f"plan: no plan of poses is called '{name}'; {did_you_mean(name, list(NAMED))}")


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
    for effect, limit in _limits(options.wanted, names).items():
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


def _limits(wanted: tuple[str, ...], model: list[str]) -> dict[str, float]:
    """Largest errors by effect, µg per unit of the column."""
    limits: dict[str, float] = {}
    for text in wanted:
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
