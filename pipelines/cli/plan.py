"""``tumbleline plan``: what a recipe can and cannot see, before it is measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.options import JsonOption, console, print_json, print_table, short

if TYPE_CHECKING:
    from schemas.recipe import Recipe


def command(
    recipe: Annotated[
        str, typer.Argument(metavar="[RECIPE]", help="A recipe file or a built-in recipe.")
    ] = "production",
    noise: Annotated[
        float | None,
        typer.Option("--noise", min=0.0, help="White noise of the device, µg/√Hz; its preset's by default."),
    ] = None,
    wander: Annotated[
        float, typer.Option("--wander", min=0.0, help="Wander of a dwell's mean from dwell to dwell, µg.")
    ] = 0.0,
    *,
    as_json: JsonOption = False,
) -> None:
    """Say for every effect whether a recipe can see it, how well, what it is mistaken for, and what to add."""
    from pipelines.planned import refuse_unidentified
    from pipelines.recipes import load_recipe
    from pipelines.stages.plan import plan

    found = load_recipe(recipe)
    refuse_unidentified(found)
    document = plan(found, _density(found) if noise is None else noise, wander)
    if as_json:
        print_json(document)
    else:
        _print(document)


def _density(recipe: Recipe) -> float:
    """White noise of the recipe's device, µg/√Hz."""
    from stations.plant.preset import load_preset

    return load_preset(recipe.device).noise_density_ug


def _print(document: dict[str, Any]) -> None:
    minutes = document["minutes"]
    error = document["dwell_error_ug"]["together"]
    console().print(
        f"[bold]{document['recipe']}[/bold]: {document['poses']} poses × {len(document['temperatures_C'])} temperatures, "
        f"{minutes['total']:.0f} min of station time (soaks {minutes['soaks']:.0f} min, moves {minutes['moves']:.0f} min, "
        f"dwells {minutes['dwells']:.0f} min, static record {minutes['static_record']:.0f} min); "
        f"error of a dwell {short(error)} µg"
    )
    seen = [row for row in document["effects"] if row["seen"]]
    lines = [[r["effect"], short(r["left"]), short(r["floor_ug"]), ", ".join(r["alias"]) or "–"] for r in seen]
    print_table(["seen", "left v", "floor 3σ, µg", "not told from"], lines)
    blind = [row for row in document["effects"] if not row["seen"]]
    print_table(["not seen", "add"], [[r["effect"], r["breaker"]] for r in blind])
