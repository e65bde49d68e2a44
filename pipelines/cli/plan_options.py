"""Options that both commands of tumbleline plan have, and the recipe that they state."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from schemas.recipe import Recipe

DeviceOption = Annotated[
    str,
    typer.Option(
        "--device", metavar="PRESET", help="Preset with the noise of the device; the recipe's device by default."
    ),
]
NoiseOption = Annotated[
    float | None,
    typer.Option("--noise", min=0.0, help="White noise density of the device, µg/√Hz; the preset's by default."),
]
WanderOption = Annotated[
    float | None,
    typer.Option(
        "--wander",
        min=0.0,
        help="Flicker floor of the Allan deviation, µg, without random walk; flicker and random walk of the preset by default.",
    ),
]
EffectsOption = Annotated[
    str, typer.Option("--effects", metavar="a,b,c", help="Effects of the model; the recipe's by default.")
]
PageOption = Annotated[
    Path | None, typer.Option("--page", metavar="FILE.html", help="Also write an HTML page with pictures to this file.")
]


def with_model(recipe: str, effects: str, model: Path | None, archive: str | None, station: str) -> Recipe:
    """The recipe, with another model where one is given; the archive is read only for a recipe with the line's model."""
    from pipelines.jobs.model_files import chosen_effects, use_formulas
    from pipelines.jobs.recipes import load_recipe

    chosen = chosen_effects(effects, model, "plan")

    def line(device: str) -> dict[str, Any]:
        from pipelines.archive import Archive
        from pipelines.jobs.releases import line_model

        if chosen:
            return {"effects": chosen}
        keys = line_model(Archive(archive), device, station)
        use_formulas(keys["formulas"], "the line's model")
        return keys

    loaded = load_recipe(recipe, line)
    return loaded.model_copy(update={"effects": list(chosen)}) if chosen else loaded
