"""``tumbleline plan``: visible effects, expected errors and station time of a recipe; ``plan optimise``: a quicker recipe."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from pipelines.cli.options import (
    ArchiveOption,
    JsonOption,
    ModelOption,
    RecipeArgument,
    StationOption,
    console,
    print_json,
    print_table,
    short,
)
from pipelines.cli.reach_text import print_reach
from schemas.errors import PART_FAILED

if TYPE_CHECKING:
    from typer._click import Context

    from pipelines.planning.plan import PlanContext
    from schemas.limits import Limits
    from schemas.recipe import Recipe

PART = "Measure"
ORDER = 120
SUMMARY = "Show what a recipe can and cannot determine, before anything is measured."
EXAMPLES = (
    "tumbleline plan my.toml",
    "tumbleline plan optimise my.toml",
)

RAISED = 3.0
"""Factor by which 1/f and random walk must raise a floor to be listed."""

RECIPE = "recipe"


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


@app.command(RECIPE)
def command(
    recipe: RecipeArgument = "production",
    device: DeviceOption = "",
    station: StationOption = None,
    effects: EffectsOption = "",
    model: ModelOption = None,
    noise: NoiseOption = None,
    wander: WanderOption = None,
    page: PageOption = None,
    archive: ArchiveOption = None,
    pictures: Annotated[
        Path | None,
        typer.Option("--pictures", metavar="DIR", help="Also write the pictures to this folder, as RECIPE-NAME.svg."),
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show station time, expected errors, and for every effect its visibility, detection floor and confounded effects.

    For effects that are not visible: the reason, and what to add to the recipe.
    """
    from pipelines.jobs.recipes import folder_of
    from pipelines.jobs.terms import planned_terms
    from pipelines.planning.plan import plan, plan_context
    from pipelines.planning.preset_noise import noise_of
    from schemas.station import load_station

    config = load_station(station)
    found = with_model(recipe, effects, model, archive, config.name)
    context = plan_context(found, config, noise_of(found, device or found.device, noise, wander))
    limits = _limits(found, folder_of(recipe))
    document = plan(context, planned_terms(found, config, limits), limits)
    if page is not None:
        _write(page, document, context)
        document["page"] = str(page)
    if pictures is not None:
        _draw(pictures, document, context)
    if as_json:
        print_json(document)
    else:
        _print(document)
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
            "--output", "-o", metavar="FILE.toml", help="File of the new recipe; NAME-optimal.toml by default."
        ),
    ] = None,
    device: DeviceOption = "",
    station: StationOption = None,
    effects: EffectsOption = "",
    model: ModelOption = None,
    see: Annotated[
        str,
        typer.Option(
            "--see",
            metavar="a,b,c",
            help="Further effects that must be visible; those of the textbook plan by default.",
        ),
    ] = "",
    wanted: Annotated[
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
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Write the recipe with the least station time that reaches the required errors.

    By default these are the errors of the textbook plan (24 orthogonal poses at nine soaks up and down, 15 min each, dwells of
    10 s) over the same temperatures, and every effect that is visible under it stays visible. With --criterion T --part a,b: the
    recipe with the least station time that discriminates between these effects.
    """
    from pipelines.cli.optimal import OptimiseOptions, cheapest_recipe, missing_limits, print_optimum, written
    from pipelines.jobs.recipes import folder_of
    from pipelines.planning.preset_noise import noise_of
    from schemas.station import load_station

    config = load_station(station)
    base = with_model(recipe, effects, model, archive, config.name)
    options = OptimiseOptions(
        see, tuple(wanted or ()), factor, temperatures, poses, criterion, verification, part, size, separation
    )
    optimum, document = cheapest_recipe(
        base, Path(recipe).name, config, noise_of(base, device or base.device, noise, wander), options
    )
    target = output or Path(f"{optimum.planned.recipe.name}.toml")
    document["file"] = str(target)
    home = folder_of(recipe)
    document["limits_missing"] = missing_limits(base, home)
    _save(target, written(optimum, target, home, document))
    if page is not None:
        _write(page, document["plan"], optimum.planned)
        document["page"] = str(page)
    if as_json:
        print_json(document)
    else:
        print_optimum(document)


def _limits(recipe: Recipe, home: Path) -> Limits | None:
    """The limits that a recipe names; None where they are not there, which a plan does not need."""
    from pipelines.jobs.recipes import load_limits
    from schemas.errors import RecipeInvalid

    try:
        return load_limits(recipe, home)
    except RecipeInvalid:
        return None


def _save(path: Path, text: str) -> None:
    """Write a file; a folder that does not exist or cannot be written to is wrong use."""
    from schemas.errors import WrongUse

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as problem:
        raise WrongUse(
            f"plan: {path} cannot be written ({problem.strerror}); give a file in a folder that exists and is writable"
        ) from None


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

    found = load_recipe(recipe, line)
    return found.model_copy(update={"effects": list(chosen)}) if chosen else found


def _write(page: Path, document: dict[str, Any], context: PlanContext) -> None:
    """Write the page."""
    from pipelines.report.plan import render_plan

    _save(page, render_plan(document, context))


def _draw(folder: Path, document: dict[str, Any], context: PlanContext) -> None:
    """Write each picture to a file."""
    from pipelines.report.plan import pictures

    for name, text in pictures(document, context).items():
        if text:
            _save(folder / f"{document['recipe']}-{name}.svg", text)


def _print(document: dict[str, Any]) -> None:
    minutes, error = document["minutes"], document["dwell_error_ug"]
    out = console()
    out.print(
        f"{document['recipe']} with {document['device']} on station {document['station']}: "
        f"{document['dwells']} dwells in {document['poses']} poses at {_soaks(len(document['temperatures_C']))}"
    )
    parts = " + ".join(f"{name.replace('_', ' ')} {minutes[name]:.0f}" for name in minutes if name != "total")
    out.print(f"{minutes['total']:.0f} min of station time: {parts}")
    out.print(
        f"error of a dwell (1σ): {short(error['together'])} µg; white {short(error['white'])}, wander {short(error['wander'])}"
        f"{_longer(document['dwell_s'])}"
    )
    print_table(["coefficient", "error x, 1σ", "y", "z", "unit"], _coefficient_lines(document["coefficients"]))
    if document["bias"] is not None:
        bias = document["bias"]
        again = (
            "no repeatability is stated" if bias["switch_on_u_ug"] is None else f"{short(bias['switch_on_u_ug'])} µg"
        )
        out.print(
            f"bias, 1σ of the worst axis: as the mean of the record {short(bias['record_u_ug'])} µg, of the day after it "
            f"{short(bias['long_u_ug'])} µg; after the next switch-on: {again}"
        )
    print_reach(document.get("uncertainty"))
    seen = [row for row in document["effects"] if row["seen"]]
    print_table(
        ["visible effect", "v", "1/v²", "floor, µg", "coefficient", "unit", "confounded with"],
        [_visible_line(row) for row in seen],
    )
    faint = [row["effect"] for row in seen if row["faint"]]
    if faint:
        names = ", ".join(faint)
        out.print(f"* floor above the typical size: {names}")
    out.print(
        "v: fraction of the effect's column that remains after the model; 1/v²: variance inflation; floor: smallest detectable "
        "contribution to a dwell (3σ, RMS), and its coefficient; =: identical under this plan",
        style="dim",
    )
    raised = [r for r in seen if r["floor_white_ug"] and r["floor_size_ug"] > RAISED * r["floor_white_ug"]]
    if raised:
        raised.sort(key=lambda r: -r["floor_size_ug"] / r["floor_white_ug"])
        lines = [[r["effect"], short(r["floor_size_ug"]), short(r["floor_white_ug"]), r["breaker"]] for r in raised[:5]]
        heads = ["raised by slow noise", "floor\nµg", "white only\nµg", "what lowers it"]
        print_table(heads, lines)
    in_part = [
        [row["effect"], "; ".join(r["text"] for r in row["unseen_ranges"])] for row in seen if row["unseen_ranges"]
    ]
    if in_part:
        print_table(["effect visible in part", "not visible for"], in_part)
    invisible = [row for row in document["effects"] if not row["seen"]]
    print_table(
        ["effect not visible", "reason; what to add"], [[r["effect"], r["why"] or r["breaker"]] for r in invisible]
    )
    if "page" in document:
        out.print(f"Page: {document['page']}")


def _soaks(count: int) -> str:
    return f"{count} soak{'' if count == 1 else 's'}"


def _longer(dwell: dict[str, float]) -> str:
    """The effect of longer dwells on the error, as a clause; empty without wander."""
    import math

    balanced = dwell["white_as_large_as_wander"]
    if not math.isfinite(balanced):
        return ""
    if balanced < dwell["planned"]:
        return "; longer dwells hardly reduce it"
    return f"; longer dwells reduce it, up to {short(balanced, 2)} s"


def _coefficient_lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    """One line per coefficient with its three axes; one value for parameters of the station."""
    lines: dict[tuple[str, int], list[str]] = {}
    count: dict[tuple[str, str], int] = {}
    for row in rows:
        place = count.get((row["effect"], row["axis"]), 0)
        count[row["effect"], row["axis"]] = place + 1
        key = (row["effect"], place if row["axis"] != "*" else 100 + place)
        line = lines.setdefault(key, [row["effect"] if place == 0 else "", "", "", "", row["unit"]])
        line[1 + max(0, "xyz".find(row["axis"]))] = short(row["uncertainty_ug"])
    return list(lines.values())


def _visible_line(row: dict[str, Any]) -> list[str]:
    size = short(row["floor_size_ug"]) + (" *" if row["faint"] else "")
    v, inflation = short(row["left"]), short(row["variance_inflation"])
    return [row["effect"], v, inflation, size, scientific(row["floor_ug"]), row["floor_unit"], _aliases(row)]


def scientific(value: float) -> str:
    """A number for people, from a million on as a power of ten."""
    import math

    if abs(value) < 1e6:
        return short(value)
    exponent = math.floor(math.log10(abs(value)))
    return f"{value / 10.0**exponent:.2f}·10{str(exponent).translate(str.maketrans('0123456789', '⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def _aliases(row: dict[str, Any]) -> str:
    exact = set(row["alias_exact"])
    return ", ".join(f"={name}" if name in exact else name for name in row["alias"]) or "–"
