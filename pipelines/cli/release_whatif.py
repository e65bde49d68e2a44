"""``tumbleline release whatif``: the effect of a model on the lots of the archive, before its release to the line."""

from pathlib import Path
from typing import Annotated, Any

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli import options
from pipelines.cli.inputs import distribution
from pipelines.cli.options import argument
from pipelines.cli.printing import conclude, error_console, print_table, say, short
from pipelines.stages.figures import plain_reason

SHOWN = 12


def whatif(
    model: Annotated[Path, argument("MODEL", "A model file.")],
    selection: Annotated[
        list[str] | None, argument("[SELECTION…]", "Runs as for 'tumbleline rerun'; default: all.")
    ] = None,
    limits: options.OtherLimitsOption = "",
    effect_file: options.EffectFileOption = None,
    archive: options.ArchiveOption = None,
    dask: options.DaskOption = "",
    workers: options.WorkersOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Show the effect of a model on the lots of the archive: yield, errors, and errors on later runs, with old and new model.

    The lots are fitted, verified and graded in memory; only the result is stored, as evidence for 'tumbleline release'. Exit
    status 1: the model is not better.
    """
    from pipelines.jobs.model_change import change_from_options
    from pipelines.rerun.selection import selected
    from pipelines.rerun.whatif import BETTER, evaluated

    change = change_from_options("", model, limits, effect_file, where="release whatif")
    store = Archive(archive)
    runs = [entry.id for entry in selected(store, selection or ["all"])]
    distribute, count = distribution(store, runs, dask, workers)
    with error_console().status(f"evaluating {number_of(len(runs), 'lot')}, {count} at a time"):
        document = evaluated(store, runs, change, distribute, count)
    conclude({"archive": str(store.root), **document}, _print, as_json=as_json, passed=document["verdict"] == BETTER)


def _print(document: dict[str, Any]) -> None:
    title = f"{document['name']} version {document['version']} on {number_of(document['lots'], 'lot')}"
    rows = [(f"{row['device']} on {row['station']}", row) for row in document["groups"]]
    lines = [line for name, row in [*rows, ("all", document["total"])] for line in _lines(name, row)]
    heads = ["device", "model", "units", "yield", "fit\nµg", "not\nfitted\nµg", "later\nrun\nµg"]
    print_table(heads, lines, title=title, fixed=2)
    for key, outcome in (("to_fail", "fail with the new model only"), ("to_pass", "pass with the new model only")):
        rows = document["flips"][key]
        if rows:
            say(f"{number_of(len(rows), 'unit')}: {outcome}")
            for row in rows[:SHOWN]:
                say(f"  {row['unit']} in {row['run']}: {plain_reason(row['reasons'])}", style="dim")
    for row in document["failed"]:
        say(f"  {row['run']}: {row['error']}", style="bold red")
    style = {"better": "bold green", "worse": "bold red"}.get(document["verdict"], "bold")
    say(f"{document['verdict']}: {document['words']}", style=style)
    say(f"evidence  {document['evidence']}")


def _lines(name: str, row: dict[str, Any]) -> list[list[str]]:
    lines = [[name, "old", str(row["units"])], ["", "new", ""]]
    for number, line in enumerate(lines):
        rate = row["yield"][number]
        errors = [short(row[key][number]) for key in ("fit_rms_ug", "verification_rms_ug", "fresh_rms_ug")]
        line += ["" if rate is None else f"{100.0 * rate:.0f} %", *errors]
    return lines
