"""``tumbleline diagnose``: whether a model is adequate, where it fails, and which effect is missing."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import Archive, files
from pipelines.cli import options
from pipelines.cli.options import option
from pipelines.cli.printing import conclude, error_console, publish
from schemas.errors import WrongUse

if TYPE_CHECKING:
    import pandas as pd

    from pipelines.diagnosis.diagnose import Examination
    from pipelines.diagnosis.documents import DiagnosisDocument
    from schemas.recipe import Recipe

PART = "Is the model good enough, and what is missing?"
ORDER = 220
SUMMARY = "Judge whether a model is adequate, where it fails, and which effect is missing."
EXAMPLES = (
    "tumbleline diagnose latest",
    "tumbleline diagnose dwells.csv --effects bias,scale,misalignment --output report.html",
)


def command(
    dwells: options.DwellsArgument,
    effects: options.EffectsOption = "",
    model: options.ModelOption = None,
    temperatures: options.TemperaturesOption = "",
    effect_file: options.EffectFileOption = None,
    formula: options.FormulaOption = None,
    leave_out: options.LeaveOutOption = "",
    output: Annotated[
        list[Path] | None,
        option(
            "--output -o FILE",
            "The diagnosis with pictures as a page (.html), or a recipe (.toml): the measured one with the proposed steps; may "
            "be repeated.",
        ),
    ] = None,
    recipe: Annotated[
        str, option("--recipe RECIPE", "Recipe of the dwells, for the one to write; a run of the archive has its own.")
    ] = "",
    archive: options.ArchiveOption = None,
    *,
    show_all: options.AllOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Judge whether a model is adequate, where it fails, and which physical effect is missing.

    Exit status 0: the model is adequate. 1: it is not, it cannot be judged, or every unit has a data fault. 2: the input cannot
    be used.
    """
    from pipelines.cli.inputs import add_effects, dwells_and_history, start_reader, without_dwells

    start_reader(dwells)
    import_module("pipelines.diagnosis.diagnose")  # while the reader starts
    from pipelines.diagnosis.inputs import file_beside, judged_effects
    from pipelines.importers.files import is_file

    files = options.outputs(output, {"page": options.PAGES, "recipe": (".toml",)}, "diagnose")
    report, following = files.get("page"), files.get("recipe")
    add_effects(effect_file, formula, "diagnose")
    base = measured_recipe(dwells, recipe, archive) if following is not None else None
    judged = judged_effects(dwells, archive, effects, model, "diagnose")
    table, history = dwells_and_history(dwells, temperatures, archive)
    table, left_out = without_dwells(table, leave_out)
    beside = temperatures or (file_beside(dwells, "history") if is_file(dwells) else "")
    kept_name = dwells if is_file(dwells) else Archive(archive).run(dwells).id  # what 'latest' means changes
    made, report_text = diagnosed(table, history, judged, kept_name, with_report=report is not None, left_out=left_out)
    document = made.document
    document["history"] = beside or None
    if report is not None:
        publish(report, report_text, "report")
    if following is not None and base is not None:
        from pipelines.jobs.recipes import folder_of

        write_next(following, document, base, folder_of(recipe) if recipe else Path(), dwells)
    from pipelines.cli.next_commands import Given, judged_data
    from pipelines.cli.text.diagnosis_text import print_diagnosis

    given = Given(archive, leave_out=leave_out, effect_files=effect_file or (), formulas=formula or ())
    find = partial(judged_data, dwells, beside, given)
    show = partial(print_diagnosis, made=made, data=find, model=model, brief=not show_all)
    conclude(document, show, as_json=as_json, passed=bool(document["adequate"]))


def diagnosed(
    table: pd.DataFrame,
    history: pd.DataFrame | None,
    judged: list[str] | None,
    source: str,
    *,
    with_report: bool,
    coefficients: list[dict[str, Any]] | None = None,
    left_out: Sequence[str] = (),
) -> tuple[Examination, str]:
    """A diagnosis, and its report on request, with the coefficients of a fit if they are given."""
    with error_console().status("looking for missing effects"):
        from pipelines.diagnosis.diagnose import examination  # loads the search for effects: after the first line

        made = examination(table, history, judged, left_out)
    if not with_report:
        return made, ""
    with error_console().status("drawing the report"):
        from pipelines.report.diagnosis import render_diagnosis

        return made, render_diagnosis(made, source, coefficients)


def measured_recipe(dwells: str, recipe: str, archive: str | None) -> Recipe:
    """The recipe that dwells were measured with: the given recipe, else that of the run.

    Raises WrongUse: neither a file of dwells nor an import states its recipe, and none is named.
    """
    from pipelines.importers.files import is_file
    from pipelines.jobs.job import job_of_run
    from pipelines.jobs.recipes import load_recipe

    if recipe:
        return load_recipe(recipe)
    if is_file(dwells) or not Archive(archive).run(dwells).about.get("capture"):
        raise WrongUse(
            f"diagnose: a recipe to measure next needs the one that {dwells} was measured with (device, poses, soaks), which "
            "dwells do not state; add --recipe FILE"
        )
    return job_of_run(Archive(archive).run(dwells)).recipe


def write_next(path: Path, document: DiagnosisDocument, base: Recipe, home: Path, source: str) -> None:
    """Write the proposed measurement as a recipe and print its path; without proposed steps nothing is written.

    base : the recipe that the dwells were measured with; home : its folder
    source : the dwells as they were named
    """
    from pipelines.cli.next_commands import command_line
    from pipelines.diagnosis.next_measurement import next_recipe, reasons
    from pipelines.jobs.recipe_text import limits_from, recipe_text

    out, rows = error_console(), document["next_measurements"]
    if not reasons(rows):
        out.print(f"next: no steps of the station are proposed; {path} is not written")
        return
    limits = limits_from(base.limits, home, path.parent)
    recipe = next_recipe(base, rows, path.stem).model_copy(update={"limits": limits})
    remarks = [f"Written by 'tumbleline diagnose' from {source}: recipe {base.name}, then", *reasons(rows)]
    remarks += [f"without formula {formula.id}: name the model file with 'model'" for formula in base.formulas]
    files.publish(path, recipe_text(recipe, remarks).encode(), "recipe", files.ELSEWHERE)
    out.print(f"next: {path}; to see what it determines:")
    out.print(f"  {command_line('plan', str(path))}")
