"""What ``tumbleline plan optimise`` is asked, finds, writes and prints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast, get_args

from pipelines.cli.options import console, error_console, print_table, short
from schemas.errors import WrongUse, did_you_mean
from schemas.units import MICRO

if TYPE_CHECKING:
    from pathlib import Path

    from inertial.noise.dwells import DwellNoise
    from pipelines.stages.optimise import Optimum, Wish
    from pipelines.stages.plan import Planned
    from schemas.recipe import Recipe
    from schemas.station import StationConfig


@dataclass(frozen=True)
class Asked:
    """The options of the command, as they were given."""

    see: str
    wanted: tuple[str, ...]
    factor: float
    temperatures: str
    poses: str
    criterion: str
    verification: int | None = None


def found(base: Recipe, station: StationConfig, noise: DwellNoise, asked: Asked) -> tuple[Optimum, dict[str, Any]]:
    """The cheapest recipe, and the document about it."""
    from pipelines.stages.optimise import optimise, textbook, verified_in
    from pipelines.stages.plan import plan, planned

    levels = _levels(base, asked.temperatures)
    against = planned(textbook(base, levels), station, noise)
    wish = replace(_wish(asked, against, levels), verification=asked.verification or verified_in(base))
    progress = error_console()
    with progress.status("looking for the cheapest recipe") as status:
        best = optimise(base, against, wish, lambda note: status.update(f"looking: {note}"))
    return best, document(best, plan(best.planned), plan(against))


def _levels(base: Recipe, temperatures: str) -> tuple[float, ...]:
    """Temperatures to meet, from the lowest."""
    try:
        given = [float(part) for part in temperatures.split(",")] if temperatures else base.temperatures_C
    except ValueError:
        message = f"plan: --temperatures '{temperatures}' is no list of numbers; write -10,25,60"
        raise WrongUse(message) from None
    return tuple(sorted(set(given)))


def _wish(asked: Asked, against: Planned, levels: tuple[float, ...]) -> Wish:
    from inertial.exchange import Criterion
    from inertial.poses import NAMED
    from pipelines.models import refuse_unknown_effects
    from pipelines.stages.optimise import Wish, candidates, seen_by
    from pipelines.stages.plan import identified

    if asked.criterion not in get_args(Criterion):
        message = f"plan: no criterion '{asked.criterion}'; {did_you_mean(asked.criterion, get_args(Criterion))}"
        raise WrongUse(message)
    if asked.poses and asked.poses not in NAMED:
        message = f"plan: no plan of poses is called '{asked.poses}'; {did_you_mean(asked.poses, list(NAMED))}"
        raise WrongUse(message)
    see = tuple(part.strip() for part in asked.see.split(",") if part.strip())
    refuse_unknown_effects(see, "plan: --see")
    expected = identified(against)
    errors = asked.factor * expected.errors
    for effect, limit in _limits(asked.wanted, [name for name, _ in expected.names[0]]).items():
        for column, (name, _) in enumerate(expected.names[0]):
            if name == effect:
                errors[:, column] = limit / MICRO
    return Wish(
        wanted=errors,
        see=see or seen_by(against, levels),
        levels=levels,
        candidates=candidates(against.station, asked.poses),
        criterion=cast("Criterion", asked.criterion),
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
            message = f"plan: --wanted '{text}': '{effect}' is not in the model; {did_you_mean(effect, model)}"
            raise WrongUse(message)
        if not limits[effect] > 0.0:
            message = f"plan: --wanted '{text}': a positive error in µg is needed; write {effect}=50"
            raise WrongUse(message)
    return limits


def document(best: Optimum, plan: dict[str, Any], textbook: dict[str, Any]) -> dict[str, Any]:
    """What was found, for programs."""
    wanted = best.wanted
    place = {"x": 0, "y": 1, "z": 2}
    columns: dict[str, int] = {}
    rows: list[dict[str, Any]] = []
    for row in plan["coefficients"]:
        if row["axis"] in place:
            column = columns.setdefault(row["axis"], 0)
            columns[row["axis"]] += 1
            rows.append({**row, "wanted_ug": MICRO * float(wanted[place[row["axis"]], column])})
    seen = {row["effect"] for row in textbook["effects"] if row["seen"]}
    return {
        "recipe": plan["recipe"],
        "dwell_s": plan["dwell_s"]["planned"],
        "temperatures_C": plan["temperatures_C"],
        "poses": plan["poses"],
        "dwells": plan["dwells"],
        "minutes": plan["minutes"],
        "textbook_minutes": textbook["minutes"],
        "share": best.share,
        "verification_dwells": _verification(best.planned.recipe),
        "worst": best.worst,
        "coefficients": rows,
        "seen_besides": sorted({row["effect"] for row in plan["effects"] if row["seen"]} - seen),
        "plan": plan,
    }


def _verification(recipe: Recipe) -> int:
    return sum(len(recipe.verification_at(k)) for k in range(len(recipe.temperatures_C)))


def written(best: Optimum, target: Path, home: Path) -> str:
    """The text of the recipe's file at ``target``; ``home`` is the folder of the recipe that it began from."""
    from pipelines.recipe_text import limits_from, recipe_text
    from pipelines.stages.minutes import spent

    recipe = best.planned.recipe
    limits = limits_from(recipe.limits, home, target.parent)
    minutes, textbook = (spent(p.stretches).total for p in (best.planned, best.against))
    remarks = [
        f"Found by 'tumbleline plan optimise': {minutes:.0f} min on station {best.planned.station.name}, where the textbook plan",
        f"needs {textbook:.0f} min; no coefficient's error is above {best.worst:.2f} of what was wanted.",
    ]
    return recipe_text(recipe.model_copy(update={"limits": limits}), remarks)


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
    lines = [
        [
            f"{r['effect']} {r['name']}",
            short(r["uncertainty_ug"]),
            short(r["wanted_ug"]),
            f"{r['uncertainty_ug'] / r['wanted_ug']:.2f}",
            r["unit"],
        ]
        for r in document["coefficients"]
    ]
    print_table(["coefficient", "error 1σ", "wanted", "over", "unit"], lines)
    if document["seen_besides"]:
        out.print(f"Sees besides, for nothing: {', '.join(document['seen_besides'])}")
    out.print(f"Written to {document['file']}; measure with 'tumbleline run {document['file']}'")
    if "page" in document:
        out.print(f"page: {document['page']}")
