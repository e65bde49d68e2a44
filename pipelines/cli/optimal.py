"""What ``tumbleline plan optimise`` finds, writes and prints."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pipelines.cli.asked import levels_of, wish_of
from pipelines.cli.options import console, error_console, print_table, short
from schemas.units import MICRO

if TYPE_CHECKING:
    from pathlib import Path

    from inertial.noise.dwells import DwellNoise
    from pipelines.cli.asked import Asked
    from pipelines.stages.optimise import Optimum
    from schemas.recipe import Recipe
    from schemas.station import StationConfig


LACK = 1.1
"""Errors over the textbook plan's up to which the nearest recipe is offered where nobody said what errors are wanted."""


def found(base: Recipe, station: StationConfig, noise: DwellNoise, asked: Asked) -> tuple[Optimum, dict[str, Any]]:
    """The cheapest recipe, and the document about it."""
    from pipelines.stages.optimise import optimise
    from pipelines.stages.plan import plan, planned
    from pipelines.stages.textbook import textbook
    from pipelines.stages.verification import verified_in

    levels = levels_of(base, asked.temperatures)
    against = planned(textbook(base, levels), station, noise)
    wish = wish_of(asked, base, against, levels)
    wish = replace(wish, verification=asked.verification or verified_in(base))
    progress = error_console()
    with progress.status("looking for the cheapest recipe") as status:
        lack = 1.0 if asked.errors_named else LACK
        best = optimise(base, against, wish, lambda note: status.update(f"looking: {note}"), lack=lack)
    return best, document(best, plan(best.planned))


def document(best: Optimum, plan: dict[str, Any]) -> dict[str, Any]:
    """What was found, for programs."""
    from inertial.planning import sights
    from pipelines.stages.minutes import spent
    from pipelines.stages.rivals import partings

    textbook = best.against
    seen = {s.effect for s in sights(textbook.state, textbook.recipe.effects, 1.0) if s.seen}
    there = {(row["true"], row["wrong"]): row["chi_square"] for row in partings(best.wish, textbook)}
    rivals = [{**r, "textbook": there[r["true"], r["wrong"]]} for r in partings(best.wish, best.planned)]
    return {
        "recipe": plan["recipe"],
        "dwell_s": plan["dwell_s"]["planned"],
        "temperatures_C": plan["temperatures_C"],
        "poses": plan["poses"],
        "dwells": plan["dwells"],
        "minutes": plan["minutes"],
        "textbook_minutes": spent(textbook.stretches).document(),
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
            limit = MICRO * float(best.wish.wanted[place[row["axis"]], column]) if best.wish.parting is None else None
            rows.append({**row, "wanted_ug": limit})
    return rows


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
        f"needs {textbook:.0f} min; {_reached(best)}.",
    ]
    return recipe_text(recipe.model_copy(update={"limits": limits}), remarks)


def _reached(best: Optimum) -> str:
    if best.wish.parting is None:
        return f"no coefficient's error is above {best.worst:.2f} of what was wanted"
    rivals = best.wish.effects[-len(best.wish.parting.rivals) :]
    return f"it tells {', '.join(rivals)} apart, χ² {best.wish.parting.wanted / best.worst**2:.0f} at least"


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
