"""``tumbleline plan``: effects, errors and station time of a recipe; a quicker one; a device; a line; the keys of files."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import files
from pipelines.cli import options
from pipelines.cli.groups import group
from pipelines.cli.next_commands import archive_words
from pipelines.cli.options import Setting, argument, option
from pipelines.cli.plan_choose import choose
from pipelines.cli.plan_keys import keys
from pipelines.cli.plan_line import line_schedule
from pipelines.cli.plan_order import order
from pipelines.cli.printing import conclude, give, is_standard_output, print_text, remark
from pipelines.cli.text.plan_text import print_optimum, print_plan, print_procedures
from schemas.errors import RecipeInvalid
from schemas.station import load_station

if TYPE_CHECKING:
    from pipelines.planning.context import PlanContext

PART = "Measure"
ORDER = 120
SUMMARY = "Show what a recipe can determine; choose a device; schedule a line; list keys."
EXAMPLES = ("tumbleline plan my.toml", "tumbleline plan optimise my.toml")
EXAMPLES_OF = {
    "recipe": ("tumbleline plan my.toml", "tumbleline plan my.toml --station line-1.toml --output plan.html"),
    "optimise": (
        "tumbleline plan optimise my.toml",
        "tumbleline plan optimise my.toml --criterion T:third_order,odd_quadratic --set size=10000",
    ),
    "order": ("tumbleline plan order my.toml", "tumbleline plan order my.toml --output my-first.toml"),
    "choose": (
        "tumbleline plan choose range=4g temperature=-40..85 error=2mg bandwidth=100",
        "tumbleline plan choose range=30g error=5mg --device QA700,SF1500",
    ),
    "line": (
        "tumbleline plan line two-chambers.toml",
        "tumbleline plan line two-chambers.toml --all --output line.svg",
    ),
    "keys": ("tumbleline plan keys recipe", "tumbleline plan keys fault --json"),
}
"""Of the subcommands."""


DeviceOption = Annotated[
    str, option("--device PRESET", "Preset with the noise of the device; the recipe's device by default.")
]
NoiseOption = Annotated[
    str,
    option(
        "--noise N[,B]",
        "White noise density of the device, µg/√Hz, then the flicker floor of its Allan deviation, µg, without random walk; the "
        "preset's by default.",
    ),
]
EffectsOption = Annotated[str, option("--effects a,b,c", "Effects of the model; the recipe's by default.")]


SEARCH = {
    "factor": Setting("N", "required errors as a multiple of the textbook plan's", float, 0.01),
    "temperatures": Setting("a,b,c", "required temperatures, °C; the ends of the recipe's range and others by default"),
    "poses": Setting("PLAN", "named plan of candidate poses; a Fibonacci lattice by default"),
    "size": Setting("UG", "with --criterion T: largest contribution of each effect, µg; 100 by default", float, 1e-3),
    "separation": Setting(
        "N", "with --criterion T: required χ² of the wrong effect over the lot; 50 by default", float, 1.0
    ),
    "verification": Setting("N", "repetitions of each verification pose; as in the recipe by default", int, 1.0),
    "ramp": Setting(
        "yes", "measure while the chamber ramps, without soaks; the device's temperature is read", options.yes
    ),
}


def plan_recipe(
    recipe: options.RecipeArgument = "production",
    device: DeviceOption = "",
    station: options.StationOption = None,
    effects: EffectsOption = "",
    model: options.ModelOption = None,
    noise: NoiseOption = "",
    pose: Annotated[
        list[str] | None,
        option(
            "--pose NAME=OUTER,INNER",
            "Plan with a pose at other angles, in degrees: p05 is the fifth of the fit, v1 the first of the "
            "verification; may be repeated.",
        ),
    ] = None,
    output: Annotated[
        list[Path] | None,
        option(
            "--output -o FILE|DIR",
            "A page with pictures (.html), or a folder for the pictures as RECIPE-NAME.svg; may be repeated.",
        ),
    ] = None,
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Show station time, expected errors, and for every effect its visibility, detection floor and confounded effects.

    For effects that are not visible: the reason, and what to add to the recipe. For test procedures: records, station time,
    equipment, and the figures that they determine. Exit status 1: a limit is out of reach, or 'tumbleline run' refuses the
    recipe.
    """
    from pipelines.jobs.moved_poses import moves_of, with_moved_poses
    from pipelines.jobs.priors import planned_precision
    from pipelines.jobs.recipes import folder_of, load_limits
    from pipelines.jobs.releases import planned_recipe
    from pipelines.jobs.terms import planned_terms, refuse_missing_full, refused_by_run
    from pipelines.planning.context import noise_of, plan_context, plan_of_procedures, procedure_rows
    from pipelines.planning.plan import plan

    made = options.outputs(output, {"page": options.PAGES, "pictures": ("",)}, "plan")
    page, pictures = made.get("page"), made.get("pictures")
    config = load_station(station)
    planned = planned_recipe(recipe, effects, model, archive, config.name)
    planned = with_moved_poses(planned, moves_of(pose or (), "plan"), "plan")
    refuse_missing_full(planned, folder_of(recipe))
    _tell_fillings(len(planned.units), config.devices.slots.count)
    try:
        limits = load_limits(planned, folder_of(recipe))
    except RecipeInvalid:
        limits = None  # a plan does not need them
    if not planned.tumbles and page is None and pictures is None:
        refused = _warned(refused_by_run(planned, config, folder_of(recipe)))
        document = plan_of_procedures(planned, config, limits)
        conclude(document, print_procedures, as_json=as_json, passed=not refused)
        return
    prior = planned_precision(planned, archive, config.kind)
    noise_of_device = noise_of(planned, device or planned.device, *_densities(noise))
    context = plan_context(planned, config, noise_of_device, prior=prior)
    document = plan(context, planned_terms(planned, config, limits), limits)
    refused = _warned(refused_by_run(planned, config, folder_of(recipe)))
    if planned.procedures:
        document["procedures"] = procedure_rows(planned, config, limits)
    if page is not None:
        write_page(page, document, context)
        document["page"] = str(page)
    if pictures is not None:
        write_pictures(pictures, document, context)
    passed = not refused and not (document.get("uncertainty") or {}).get("unreachable")
    conclude(document, print_plan, as_json=as_json, passed=passed)


def _tell_fillings(units: int, slots: int) -> None:
    """Say how often a fixture is filled for a lot that is larger: the plan is that of one filling."""
    if units > slots:
        remark(
            f"{units} units, the fixture has {slots} slots: {-(-units // slots)} fillings, each of the station time below; "
            "'tumbleline run' asks for each at a terminal, and refuses such a lot elsewhere"
        )


def _warned(messages: list[str]) -> list[str]:
    """Print why 'tumbleline run' refuses the recipe."""
    for message in messages:
        remark(f"warning: 'tumbleline run' refuses this recipe: {message}", style="yellow")
    return messages


def optimise(
    recipe: Annotated[
        str, argument("[RECIPE]", "Recipe to start from: device, sample rate, soak, temperature range, limits.")
    ] = "production",
    output: Annotated[
        list[Path] | None,
        option(
            "--output -o FILE",
            "The new recipe (.toml; - prints it; NAME-optimal.toml by default), and a page with pictures (.html).",
        ),
    ] = None,
    device: DeviceOption = "",
    station: options.StationOption = None,
    effects: EffectsOption = "",
    model: options.ModelOption = None,
    wanted: Annotated[
        list[str] | None,
        option(
            "--wanted EFFECT[=µg]",
            "Effect that must be visible, or with the required error (1σ) of its coefficients, besides those of the textbook "
            "plan; may be repeated.",
        ),
    ] = None,
    criterion: Annotated[
        str,
        option(
            "--criterion",
            "worst (coefficient), A (mean variance), D (volume), or T:a,b (discrimination between these effects).",
        ),
    ] = "worst",
    setting: Annotated[list[str] | None, options.set_option(SEARCH)] = None,
    noise: NoiseOption = "",
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Write the recipe with the least station time that reaches the required errors.

    By default these are the errors of the textbook plan (24 orthogonal poses at nine soaks up and down, 15 min each, dwells of
    10 s) over the same temperatures, and every effect that is visible under it stays visible. With --criterion T:a,b: the
    recipe with the least station time that discriminates between these effects.
    """
    from pipelines.cli.optimal import OptimiseOptions, cheapest_recipe, missing_limits, written
    from pipelines.jobs.priors import planned_precision
    from pipelines.jobs.recipes import folder_of
    from pipelines.jobs.releases import planned_recipe
    from pipelines.planning.context import noise_of

    files_by_kind = options.outputs(output, {"recipe": (".toml", "-"), "page": options.PAGES}, "plan optimise")
    file, page = files_by_kind.get("recipe"), files_by_kind.get("page")
    printed = is_standard_output(file, "plan optimise", as_json=as_json)
    config = load_station(station)
    base = planned_recipe(recipe, effects, model, archive, config.name)
    given = options.settings(setting, SEARCH, "plan optimise")
    kind, _, parts = criterion.partition(":")
    see = [text for text in wanted or () if "=" not in text]
    errors = [text for text in wanted or () if "=" in text]
    search = OptimiseOptions(see=",".join(see), required_errors=errors, criterion=kind, part=parts, **given)
    noise_of_device = noise_of(base, device or base.device, *_densities(noise))
    prior = planned_precision(base, archive, config.kind)
    optimum, document = cheapest_recipe(base, Path(recipe).name, config, noise_of_device, search, prior)
    target = file or Path(f"{optimum.planned.recipe.name}.toml")
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
        where = [*(["--station", str(station)] if station else []), *archive_words(archive)]
        give(document, partial(print_optimum, where=where), as_json=as_json)


def _densities(noise: str) -> tuple[float | None, float | None]:
    """Density and flicker floor of ``--noise``; None for what is not given."""
    white, _, flicker = noise.partition(",")
    values = options.settings(
        [f"{key}={text}" for key, text in (("noise", white), ("flicker", flicker)) if text.strip()],
        NOISE,
        "plan",
        "--noise: ",
    )
    return values.get("noise"), values.get("flicker")


NOISE = {key: Setting("N", "", float, 0.0) for key in ("noise", "flicker")}


def write_page(page: Path, document: dict[str, Any], context: "PlanContext") -> None:
    """Write the page."""
    from pipelines.report.plan import render_plan

    files.publish(page, render_plan(document, context).encode(), "plan", files.ELSEWHERE)


def write_pictures(folder: Path, document: dict[str, Any], context: "PlanContext") -> None:
    """Write each picture to a file."""
    from pipelines.drawing.vector import alone
    from pipelines.report.plan import pictures

    for name, text in pictures(document, context).items():
        if text:
            files.publish(folder / f"{document['recipe']}-{name}.svg", alone(text).encode(), "plan", files.ELSEWHERE)


app = group(
    "Show visible effects, expected errors and station time of a recipe; write a quicker one; choose a device; schedule a line; "
    "list keys.",
    {
        "recipe": plan_recipe,
        "optimise": optimise,
        "order": order,
        "choose": choose,
        "line": line_schedule,
        "keys": keys,
    },
    usual="recipe",
)
