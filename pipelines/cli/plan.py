"""``tumbleline plan``: visible effects, expected errors and station time of a recipe; ``plan optimise``: a quicker recipe."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from pipelines.archive import files
from pipelines.cli import options
from pipelines.cli.options import argument, option
from pipelines.cli.printing import conclude, give, is_standard_output, print_text, remark
from pipelines.cli.text.plan_text import print_optimum, print_plan, print_procedures
from schemas.errors import RecipeInvalid

if TYPE_CHECKING:
    from typer._click import Context

    from pipelines.planning.context import PlanContext

PART = "Measure"
ORDER = 120
SUMMARY = "Show what a recipe can and cannot determine, before anything is measured."
EXAMPLES = ("tumbleline plan my.toml", "tumbleline plan optimise my.toml")
EXAMPLES_OF = {
    "recipe": ("tumbleline plan my.toml", "tumbleline plan my.toml --station line-1.toml --page plan.html"),
    "optimise": (
        "tumbleline plan optimise my.toml",
        "tumbleline plan optimise my.toml --criterion T --part third_order,odd_quadratic --size 10000",
    ),
}
"""Of the subcommands."""


RECIPE = "recipe"


DeviceOption = Annotated[
    str, option("--device PRESET", "Preset with the noise of the device; the recipe's device by default.")
]
NoiseOption = Annotated[
    float | None, option("--noise", "White noise density of the device, µg/√Hz; the preset's by default.", min=0.0)
]
WanderOption = Annotated[
    float | None,
    option(
        "--wander",
        "Flicker floor of the Allan deviation, µg, without random walk; flicker and random walk of the preset by default.",
        min=0.0,
    ),
]
EffectsOption = Annotated[str, option("--effects a,b,c", "Effects of the model; the recipe's by default.")]
PageOption = Annotated[Path | None, option("--page FILE.html", "Also write an HTML page with pictures to this file.")]


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
        option(
            "--pose NAME=OUTER,INNER",
            "Plan with a pose at other angles, in degrees: p05 is the fifth of the fit, v1 the first of the "
            "verification; may be repeated.",
        ),
    ] = None,
    page: PageOption = None,
    archive: options.ArchiveOption = None,
    pictures: Annotated[
        Path | None, option("--pictures DIR", "Also write the pictures to this folder, as RECIPE-NAME.svg.")
    ] = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Show station time, expected errors, and for every effect its visibility, detection floor and confounded effects.

    For effects that are not visible: the reason, and what to add to the recipe. For test procedures: records, station time,
    equipment, and the figures that they determine.
    """
    from pipelines.jobs.moved_poses import moves_of, with_moved_poses
    from pipelines.jobs.recipes import folder_of, load_limits
    from pipelines.jobs.releases import planned_recipe
    from pipelines.jobs.terms import planned_terms, refused_by_run
    from pipelines.planning.context import noise_of, plan_context, plan_of_procedures, procedure_rows
    from pipelines.planning.plan import plan
    from schemas.station import load_station

    config = load_station(station)
    planned = planned_recipe(recipe, effects, model, archive, config.name)
    planned = with_moved_poses(planned, moves_of(pose or (), "plan"), "plan")
    for message in refused_by_run(planned, config, folder_of(recipe)):
        remark(f"warning: 'tumbleline run' refuses this recipe: {message}", style="yellow")
    try:
        limits = load_limits(planned, folder_of(recipe))
    except RecipeInvalid:
        limits = None  # a plan does not need them
    if not planned.tumbles and page is None and pictures is None:
        give(plan_of_procedures(planned, config, limits), print_procedures, as_json=as_json)
        return
    context = plan_context(planned, config, noise_of(planned, device or planned.device, noise, wander))
    document = plan(context, planned_terms(planned, config, limits), limits)
    if planned.procedures:
        document["procedures"] = procedure_rows(planned, config, limits)
    if page is not None:
        write_page(page, document, context)
        document["page"] = str(page)
    if pictures is not None:
        write_pictures(pictures, document, context)
    conclude(document, print_plan, as_json=as_json, passed=not (document.get("uncertainty") or {}).get("unreachable"))


@app.command()
def optimise(
    recipe: Annotated[
        str, argument("[RECIPE]", "Recipe to start from: device, sample rate, soak, temperature range, limits.")
    ] = "production",
    output: Annotated[
        Path | None,
        option("--output -o FILE.toml", "File of the new recipe; - prints it; NAME-optimal.toml by default."),
    ] = None,
    device: DeviceOption = "",
    station: options.StationOption = None,
    effects: EffectsOption = "",
    model: options.ModelOption = None,
    see: Annotated[
        str, option("--see a,b,c", "Further effects that must be visible; those of the textbook plan by default.")
    ] = "",
    required_errors: Annotated[
        list[str] | None,
        option("--wanted EFFECT=µg", "Required error (1σ) of an effect's coefficients; may be repeated."),
    ] = None,
    factor: Annotated[
        float, option("--factor", "Required errors as a multiple of the textbook plan's.", min=0.01)
    ] = 1.0,
    temperatures: Annotated[
        str,
        option(
            "--temperatures a,b,c",
            "Required temperatures, °C; by default the ends of the recipe's range, and others between as needed.",
        ),
    ] = "",
    poses: Annotated[
        str, option("--poses PLAN", "Named plan of candidate poses; a Fibonacci lattice of directions by default.")
    ] = "",
    criterion: Annotated[
        str,
        option(
            "--criterion",
            "worst (coefficient), A (mean variance), D (volume), or T (discrimination between effects, see --part).",
        ),
    ] = "worst",
    part: Annotated[str, option("--part a,b", "With --criterion T: effects to discriminate between.")] = "",
    size: Annotated[
        float | None,
        option("--size", "With --criterion T: largest contribution of each effect, µg; 100 by default.", min=1e-3),
    ] = None,
    separation: Annotated[
        float | None,
        option(
            "--separation", "With --criterion T: required χ² of the wrong effect over the lot; 50 by default.", min=1.0
        ),
    ] = None,
    verification: Annotated[
        int | None,
        option("--verification", "Repetitions of each verification pose; as in the recipe by default.", min=1),
    ] = None,
    noise: NoiseOption = None,
    wander: WanderOption = None,
    page: PageOption = None,
    archive: options.ArchiveOption = None,
    *,
    ramp: Annotated[
        bool, option("--ramp", "Measure while the chamber ramps, without soaks; the device's temperature is read.")
    ] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write the recipe with the least station time that reaches the required errors.

    By default these are the errors of the textbook plan (24 orthogonal poses at nine soaks up and down, 15 min each, dwells of
    10 s) over the same temperatures, and every effect that is visible under it stays visible. With --criterion T --part a,b: the
    recipe with the least station time that discriminates between these effects.
    """
    from pipelines.cli.optimal import OptimiseOptions, cheapest_recipe, missing_limits, written
    from pipelines.jobs.recipes import folder_of
    from pipelines.jobs.releases import planned_recipe
    from pipelines.planning.context import noise_of
    from schemas.station import load_station

    printed = is_standard_output(output, "plan optimise", as_json=as_json)
    config = load_station(station)
    base = planned_recipe(recipe, effects, model, archive, config.name)
    wanted = OptimiseOptions(
        see, required_errors or (), factor, temperatures, poses, criterion, verification, part, size, separation, ramp
    )
    noise_of_device = noise_of(base, device or base.device, noise, wander)
    optimum, document = cheapest_recipe(base, Path(recipe).name, config, noise_of_device, wanted)
    target = output or Path(f"{optimum.planned.recipe.name}.toml")
    document["file"] = str(target)
    home = folder_of(recipe)
    document["limits_missing"] = missing_limits(base, home)
    text = written(optimum, target, home, document)
    if not printed:
        files.publish(target, text.encode(), "plan", files.ELSEWHERE)
    if page is not None:
        write_page(page, document["plan"], optimum.planned)
        document["page"] = str(page)
    if printed:  # the recipe alone: its first comments say what it reaches
        print_text(text)
    else:
        give(document, print_optimum, as_json=as_json)


def write_page(page: Path, document: dict[str, Any], context: PlanContext) -> None:
    """Write the page."""
    from pipelines.report.plan import render_plan

    files.publish(page, render_plan(document, context).encode(), "plan", files.ELSEWHERE)


def write_pictures(folder: Path, document: dict[str, Any], context: PlanContext) -> None:
    """Write each picture to a file."""
    from pipelines.drawing.vector import alone
    from pipelines.report.plan import pictures

    for name, text in pictures(document, context).items():
        if text:
            files.publish(folder / f"{document['recipe']}-{name}.svg", alone(text).encode(), "plan", files.ELSEWHERE)
