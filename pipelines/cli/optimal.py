"""``tumbleline plan optimise``: the search, the recipe file, and the printed result."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.cli.next_commands import command_line, print_next
from pipelines.cli.optimise_options import OptimiseOptions, levels_of, requirement_of
from pipelines.cli.printing import error_console, print_table, remark, say, short
from schemas.errors import TumblelineError
from schemas.recipe import Recipe
from schemas.station import StationConfig

if TYPE_CHECKING:
    from inertial.noise.dwells import DwellNoise
    from pipelines.planning.optimise import Optimum

TOLERANCE = 1.1
"""Largest ratio to the textbook plan's errors for which the nearest recipe is written, without required errors in the options."""


ERROR_HEADS = ("coefficient, unit", "error\n1σ", "required", "ratio", "given\n1σ")


def cheapest_recipe(
    base: Recipe, name: str, station: StationConfig, noise: DwellNoise, options: OptimiseOptions
) -> tuple[Optimum, dict[str, Any]]:
    """The recipe with the least station time for the required errors, and the document about it.

    Parameters
    ----------
    base : the recipe to start from; ``name`` : its name on the command line
    """
    from pipelines.planning.context import plan_context
    from pipelines.planning.optimise import optimise
    from pipelines.planning.optimum_document import optimum_document
    from pipelines.planning.requirement import verified_in
    from pipelines.planning.textbook import textbook

    levels = levels_of(base, options.temperatures)
    against = plan_context(textbook(base, levels), station, noise)
    requirement = requirement_of(options, base, against, levels)
    requirement = replace(requirement, verification=options.verification or verified_in(base))
    with error_console().status("searching for the recipe with the least station time") as status:
        tolerance = 1.0 if options.errors_named else TOLERANCE
        best = optimise(
            base,
            against,
            requirement,
            lambda note: status.update(f"searching: {note}"),
            tolerance=tolerance,
            ramp=options.ramp,
        )
    return best, optimum_document(best, base, name)


def written(best: Optimum, target: Path, home: Path, own: dict[str, Any]) -> str:
    """The text of the recipe file at ``target``.

    Parameters
    ----------
    home : folder of the recipe that the search started from
    own : the document of the search
    """
    from pipelines.jobs.recipe_text import limits_from, recipe_text

    recipe = best.planned.recipe
    limits = limits_from(recipe.limits, home, target.parent)
    remarks = [
        f"Written by 'tumbleline plan optimise' for station {best.planned.station.name}.",
        (
            f"Station time: {own['minutes']['total']:.0f} min; {own['from']}: {own['own_minutes']['total']:.0f} min; "
            f"textbook plan: {own['textbook_minutes']['total']:.0f} min."
        ),
        f"{_reached(best)}.",
    ]
    return recipe_text(recipe.model_copy(update={"limits": limits}), remarks)


def missing_limits(recipe: Recipe, home: Path) -> str:
    """What is missing where the limits of a recipe cannot be read from its folder; empty where they can."""
    from pipelines.jobs.recipes import load_limits

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


def print_optimum(document: dict[str, Any]) -> None:
    """Print the recipe found."""
    temperatures = ", ".join(f"{t:g}" for t in document["temperatures_C"])
    say(
        f"{document['recipe']}: {document['dwells']} dwells of {document['dwell_s']:g} s "
        f"in {document['poses']} poses, {'ramps to' if document['ramp'] else 'soaks at'} {temperatures} °C"
    )
    minutes, own, textbook = document["minutes"], document["own_minutes"], document["textbook_minutes"]
    parts = [
        [name.replace("_", " "), f"{minutes[name]:.0f}", f"{own[name]:.0f}", f"{textbook[name]:.0f}"]
        for name in minutes
    ]
    print_table(["station time, min", "new recipe", document["from"], "textbook plan"], parts)
    for line in _comparison(document):
        say(line)
    if document["rivals"]:
        lines = [[r["true"], r["wrong"], short(r["chi_square"]), short(r["textbook"])] for r in document["rivals"]]
        print_table(["true effect", "fitted effect", "χ², new recipe", "χ², textbook plan"], lines, whole=2)
    else:
        print_table(ERROR_HEADS, _error_lines(document["coefficients"]))
        say(f"error: of the new recipe; given: of {document['from']}", style="dim")
    if document["seen_besides"]:
        say(f"Also visible, unlike with the textbook plan: {', '.join(document['seen_besides'])}")
    say(f"Recipe file: {document['file']}")
    if document["limits_missing"]:
        remark(f"warning: {document['limits_missing']}", style="yellow")
    else:
        print_next([command_line("run", str(document["file"]))])
    if "page" in document:
        say(f"Page: {document['page']}")


def _comparison(document: dict[str, Any]) -> list[str]:
    """Sentences that compare the new recipe with the own one and the textbook plan."""
    name, more = document["from"], document["minutes"]["total"] - document["own_minutes"]["total"]
    difference = (
        f"{abs(more):.0f} min {'more' if more > 0.0 else 'less'} than {name}" if abs(more) >= 0.5 else f"as {name}"
    )
    first = (
        f"The new recipe takes {difference}, and {100.0 * document['share']:.0f} % of the textbook plan's time without the "
        f"static record; {document['verification_dwells']} dwells are for verification (textbook plan: none)."
    )
    lines = [first]
    if document["bound"] is not None:
        lines.append(
            f"Measuring without a pause on ramps would need {100.0 * document['bound']['share']:.0f} %, for "
            f"{document['bound']['effect']}: lag, ramp and wander allow no less."
        )
    worst = document["own_worst"]
    if worst is not None:
        meets = "meets the required errors" if worst <= 1.0 else f"has up to {worst:.2f} times the required errors"
        lines.append(
            f"{name} {meets}." + ("" if worst <= 1.0 else f" For errors as in {name}, give --factor {worst:.2f}.")
        )
        if worst <= 1.0 and more > 0.0:
            lines.append(f"{name} is quicker and meets the requirement: keep it.")
    if document["worst"] > 1.0:
        lines.append(
            "No recipe was found that reaches the textbook plan's errors for every coefficient; the nearest has up to "
            f"{document['worst']:.3f} times these errors. Allow larger errors with --factor, or fewer dwells with --verification."
        )
    return lines


def _error_lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    count = Counter((r["effect"], r["axis"]) for r in rows)
    several = {effect for (effect, _), number in count.items() if number > 1}
    return [
        [
            f"{r['effect']} {r['axis']}{' ' + r['name'] if r['effect'] in several else ''}, {r['unit']}",
            short(r["uncertainty_ug"]),
            short(r["wanted_ug"]),
            f"{r['uncertainty_ug'] / r['wanted_ug']:.2f}",
            short(r["own_ug"]) or "–",
        ]
        for r in rows
    ]
