"""``tumbleline plan``: visible effects, expected errors and station time of a recipe; ``plan optimise``: a quicker recipe."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from pipelines.archive import Archive
from pipelines.cli import options
from pipelines.cli.plan_files import save, write_page, write_pictures
from pipelines.cli.printing import give, is_standard_output, print_json, print_text, remark
from pipelines.cli.text.plan_text import print_plan, print_procedures
from schemas.errors import PART_FAILED, RecipeInvalid
from schemas.limits import Limits
from schemas.recipe import Recipe

if TYPE_CHECKING:
    from typer._click import Context


PART = "Measure"
ORDER = 120
SUMMARY = "Show what a recipe can and cannot determine, before anything is measured."
EXAMPLES = (
    "tumbleline plan my.toml",
    "tumbleline plan optimise my.toml",
)
EXAMPLES_OF = {
    "recipe": (
        "tumbleline plan my.toml",
        "tumbleline plan my.toml --station line-1.toml --page plan.html",
    ),
    "optimise": (
        "tumbleline plan optimise my.toml",
        "tumbleline plan optimise my.toml --criterion T --part third_order,odd_quadratic --size 10000",
    ),
}
"""Of the subcommands."""


RECIPE = "recipe"


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


class _RecipeFirst(TyperGroup):
    """A group whose first argument may be a recipe instead of a subcommand."""

    usual = RECIPE

    def parse_args(self, ctx: Context, args: list[str]) -> list[str]:
        """The arguments, with the default subcommand added where none is given."""
        args = ["optimise", *args[1:]] if args[:1] == ["optimize"] else args  # American spelling
        if not args or args[0] not in {*self.commands, "--help", "-h"}:
            args = [self.usual, *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=_RecipeFirst,
    help="Show visible effects, expected errors and station time of a recipe, or write a quicker one ('plan optimise').",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.command(RECIPE)
def command(
    recipe: options.RecipeArgument = "production",
    device: DeviceOption = "",
    station: options.StationOption = None,
    effects: EffectsOption = "",
    model: options.ModelOption = None,
    noise: NoiseOption = None,
    wander: WanderOption = None,
    pose: Annotated[
        list[str] | None,
        typer.Option(
            "--pose",
            metavar="NAME=OUTER,INNER",
            help="Plan with a pose at other angles, in degrees: p05 is the fifth of the fit, v1 the first of the "
            "verification; may be repeated.",
        ),
    ] = None,
    page: PageOption = None,
    archive: options.ArchiveOption = None,
    pictures: Annotated[
        Path | None,
        typer.Option("--pictures", metavar="DIR", help="Also write the pictures to this folder, as RECIPE-NAME.svg."),
    ] = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Show station time, expected errors, and for every effect its visibility, detection floor and confounded effects.

    For effects that are not visible: the reason, and what to add to the recipe. For test procedures: records, station time,
    equipment, and the figures that they determine.
    """
    from pipelines.jobs.moved_poses import moves_of, with_moved_poses
    from pipelines.jobs.range_of_station import refused_by_run
    from pipelines.jobs.recipes import folder_of
    from pipelines.jobs.terms import planned_terms
    from pipelines.planning.context import noise_of, plan_context, plan_of_procedures, procedure_rows
    from pipelines.planning.plan import plan
    from schemas.station import load_station

    config = load_station(station)
    planned_recipe = with_moved_poses(
        with_model(recipe, effects, model, archive, config.name), moves_of(pose or (), "plan"), "plan"
    )
    for message in refused_by_run(planned_recipe, config, folder_of(recipe)):
        remark(f"warning: 'tumbleline run' refuses this recipe: {message}", style="yellow")
    limits = _limits(planned_recipe, folder_of(recipe))
    if not planned_recipe.tumbles and page is None and pictures is None:
        document = plan_of_procedures(planned_recipe, config, limits)
        print_json(document) if as_json else print_procedures(document)
        return
    context = plan_context(
        planned_recipe, config, noise_of(planned_recipe, device or planned_recipe.device, noise, wander)
    )
    document = plan(context, planned_terms(planned_recipe, config, limits), limits)
    if planned_recipe.procedures:
        document["procedures"] = procedure_rows(planned_recipe, config, limits)
    if page is not None:
        write_page(page, document, context)
        document["page"] = str(page)
    if pictures is not None:
        write_pictures(pictures, document, context)
    give(document, print_plan, as_json=as_json)
    stated = document.get("uncertainty")
    if stated is not None and stated["unreachable"]:
        raise typer.Exit(PART_FAILED)


@app.command()
def optimise(
    recipe: Annotated[
        str,
        typer.Argument(
            metavar="[RECIPE]", help="Recipe to start from: device, sample rate, soak, temperature range, limits."
        ),
    ] = "production",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE.toml",
            help="File of the new recipe; - prints it; NAME-optimal.toml by default.",
        ),
    ] = None,
    device: DeviceOption = "",
    station: options.StationOption = None,
    effects: EffectsOption = "",
    model: options.ModelOption = None,
    see: Annotated[
        str,
        typer.Option(
            "--see",
            metavar="a,b,c",
            help="Further effects that must be visible; those of the textbook plan by default.",
        ),
    ] = "",
    required_errors: Annotated[
        list[str] | None,
        typer.Option(
            "--wanted", metavar="EFFECT=µg", help="Required error (1σ) of an effect's coefficients; may be repeated."
        ),
    ] = None,
    factor: Annotated[
        float, typer.Option("--factor", min=0.01, help="Required errors as a multiple of the textbook plan's.")
    ] = 1.0,
    temperatures: Annotated[
        str,
        typer.Option(
            "--temperatures",
            metavar="a,b,c",
            help="Required temperatures, °C; by default the ends of the recipe's range, and others between as needed.",
        ),
    ] = "",
    poses: Annotated[
        str,
        typer.Option(
            "--poses",
            metavar="PLAN",
            help="Named plan of candidate poses; a Fibonacci lattice of directions by default.",
        ),
    ] = "",
    criterion: Annotated[
        str,
        typer.Option(
            "--criterion",
            help="worst (coefficient), A (mean variance), D (volume), or T (discrimination between effects, see --part).",
        ),
    ] = "worst",
    part: Annotated[
        str, typer.Option("--part", metavar="a,b", help="With --criterion T: effects to discriminate between.")
    ] = "",
    size: Annotated[
        float | None,
        typer.Option(
            "--size", min=1e-3, help="With --criterion T: largest contribution of each effect, µg; 100 by default."
        ),
    ] = None,
    separation: Annotated[
        float | None,
        typer.Option(
            "--separation",
            min=1.0,
            help="With --criterion T: required χ² of the wrong effect over the lot; 50 by default.",
        ),
    ] = None,
    verification: Annotated[
        int | None,
        typer.Option(
            "--verification", min=1, help="Repetitions of each verification pose; as in the recipe by default."
        ),
    ] = None,
    noise: NoiseOption = None,
    wander: WanderOption = None,
    page: PageOption = None,
    archive: options.ArchiveOption = None,
    *,
    ramp: Annotated[
        bool,
        typer.Option(
            "--ramp", help="Measure while the chamber ramps, without soaks; the device's temperature is read."
        ),
    ] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write the recipe with the least station time that reaches the required errors.

    By default these are the errors of the textbook plan (24 orthogonal poses at nine soaks up and down, 15 min each, dwells of
    10 s) over the same temperatures, and every effect that is visible under it stays visible. With --criterion T --part a,b: the
    recipe with the least station time that discriminates between these effects.
    """
    from pipelines.cli.optimal import cheapest_recipe, missing_limits, print_optimum, written
    from pipelines.cli.optimise_options import OptimiseOptions
    from pipelines.jobs.recipes import folder_of
    from pipelines.planning.context import noise_of
    from schemas.station import load_station

    printed = is_standard_output(output, "plan optimise", as_json=as_json)
    config = load_station(station)
    base = with_model(recipe, effects, model, archive, config.name)
    options = OptimiseOptions(
        see,
        tuple(required_errors or ()),
        factor,
        temperatures,
        poses,
        criterion,
        verification,
        part,
        size,
        separation,
        ramp,
    )
    optimum, document = cheapest_recipe(
        base, Path(recipe).name, config, noise_of(base, device or base.device, noise, wander), options
    )
    target = output or Path(f"{optimum.planned.recipe.name}.toml")
    document["file"] = str(target)
    home = folder_of(recipe)
    document["limits_missing"] = missing_limits(base, home)
    text = written(optimum, target, home, document)
    if not printed:
        save(target, text)
    if page is not None:
        write_page(page, document["plan"], optimum.planned)
        document["page"] = str(page)
    if printed:  # the recipe alone: its first comments say what it reaches
        print_text(text)
    elif as_json:
        print_json(document)
    else:
        print_optimum(document)


def _limits(recipe: Recipe, home: Path) -> Limits | None:
    """The limits that a recipe names; None where they are not there, which a plan does not need."""
    from pipelines.jobs.recipes import load_limits

    try:
        return load_limits(recipe, home)
    except RecipeInvalid:
        return None


def with_model(recipe: str, effects: str, model: Path | None, archive: str | None, station: str) -> Recipe:
    """The recipe, with another model where one is given; the archive is read only for a recipe with the line's model."""
    from pipelines.jobs.model_files import chosen_effects, use_formulas
    from pipelines.jobs.recipes import load_recipe

    chosen = chosen_effects(effects, model, "plan")

    def line(device: str) -> dict[str, Any]:
        from pipelines.jobs.releases import line_model

        if chosen:
            return {"effects": chosen}
        keys = line_model(Archive(archive), device, station)
        use_formulas(keys["formulas"], "the line's model")
        return keys

    loaded = load_recipe(recipe, line)
    return loaded.model_copy(update={"effects": list(chosen)}) if chosen else loaded
