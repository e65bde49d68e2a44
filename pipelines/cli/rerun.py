"""``tumbleline rerun``: re-analysis of archived runs with the present code, another model or other limits."""

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli import options
from pipelines.cli.inputs import distribution
from pipelines.cli.next_commands import archive_words, command_line, print_next
from pipelines.cli.options import option
from pipelines.cli.printing import conclude, error_console, print_table, say
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.rerun.reproduce import Reproduction
    from pipelines.rerun.rerun import RerunOutcome

PART = "Old data, new models"
ORDER = 520
SUMMARY = "Re-analyse archived runs with the present code, another model or other limits."
EXAMPLES = ("tumbleline rerun all --check", "tumbleline rerun device:adxl355 since:2026-01-01 --model model.toml")

SHOWN = 40
DIFFERENCES = 3  # re-runs that are proposed for a comparison


def command(
    selection: options.SelectionArgument,
    effects: options.OtherEffectsOption = "",
    model: options.ModelOption = None,
    limits: options.OtherLimitsOption = "",
    effect_file: options.EffectFileOption = None,
    archive: options.ArchiveOption = None,
    dask: options.DaskOption = "",
    workers: options.WorkersOption = None,
    *,
    check: Annotated[
        bool, option("--check", "Write nothing; check that every table is reproduced byte for byte.")
    ] = False,
    report: Annotated[bool, option("--report", "Also make the report of every re-run.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Re-analyse archived runs with the present code, another model or other limits; only what a change affects is computed.

    Old runs are never overwritten: a changed result is a new run. After an interruption, give the same command again to continue.
    Exit status 1: a run could not be re-analysed, or with --check was not reproduced.
    """
    from pipelines.audit.index_growth import add_runs
    from pipelines.jobs.model_change import change_from_options
    from pipelines.parallel import map_partitions
    from pipelines.rerun.partition import checked, parts, run_again
    from pipelines.rerun.selection import selected

    change = change_from_options(effects, model, limits, effect_file)
    if check and (effects or model or limits):
        raise WrongUse(
            "rerun: --check with another model or limits has no stored result to compare with; leave --effects, --model and "
            "--limits out, or leave --check out and compare with 'tumbleline archive diff'"
        )
    store = Archive(archive)
    runs = [entry.id for entry in selected(store, selection)]
    (distribute, count), counted = distribution(store, runs, dask, workers), number_of(len(runs), "run")
    with error_console().status(f"re-analysing {counted}, {count} at a time"):
        function, portions = checked if check else run_again, parts(store, runs, change, count, report=report)
        found = map_partitions(function, portions, distribute, workers=count, name=f"rerun of {counted}")
    done: list[Any] = [outcome for portion in found for outcome in portion]
    if check:
        reproduced = sum(result.same for result in done)
        rows = [asdict(result) for result in done]
        checks = {"archive": str(store.root), "selected": len(done), "same": reproduced, "runs": rows}
        conclude(checks, lambda _: _print_check(done), as_json=as_json, passed=reproduced == len(done))
    add_runs(store, [outcome.new for outcome in done if outcome.new])
    document = {"archive": str(store.root), "runs": done, **_counts(done)}
    conclude(document, partial(_print, done, archive), as_json=as_json, passed=not document["failed"])


def _counts(outcomes: "list[RerunOutcome]") -> dict[str, int]:
    failed = sum(bool(outcome.error) for outcome in outcomes)
    anew = sum(bool(outcome.new) and outcome.new != outcome.run for outcome in outcomes)
    return {"selected": len(outcomes), "rerun": anew, "unchanged": len(outcomes) - anew - failed, "failed": failed}


def _print(outcomes: "list[RerunOutcome]", archive: str | None, document: dict[str, Any]) -> None:
    lines = [_line(outcome) for outcome in outcomes[:SHOWN] if not outcome.error]
    if lines:
        print_table(["run", "re-run", "changed", "stages computed"], lines, fixed=2)
    if len(outcomes) > SHOWN:
        say(f"… and {len(outcomes) - SHOWN} more; --json lists all", style="dim")
    for outcome in outcomes:
        if outcome.error:
            say(f"  {outcome.run}: {outcome.error}", style="bold red")
    say(
        f"{document['selected']} selected: {document['rerun']} re-analysed, {document['unchanged']} unchanged, "
        f"{document['failed']} failed"
    )
    anew = [outcome for outcome in outcomes if outcome.new and outcome.new != outcome.run and not outcome.error]
    print_next(
        [
            command_line("archive", "diff", outcome.run, outcome.new, *archive_words(archive))
            for outcome in anew[:DIFFERENCES]
        ]
    )


def _line(outcome: "RerunOutcome") -> list[str]:
    whats = dict.fromkeys(change["what"] for change in outcome.because)
    worked = [name for name, how in outcome.stages.items() if how == "computed"]
    return [
        outcome.run,
        outcome.new if outcome.new != outcome.run else "—",
        ", ".join(whats) or "nothing",
        ", ".join(worked) or "none",
    ]


def _print_check(results: "list[Reproduction]") -> None:
    tables = 0
    for result in results:
        tables += sum(how == "same bytes" for how in result.tables.values())
        for line in [result.error] if result.error else result.differences:
            say(f"  {result.run}: {line}", style="bold red")
        if result.differences:
            unknown = "neither code nor libraries; the computer differs or the stored file is damaged"
            say(f"    changed since: {', '.join(result.changed) or unknown}")
    left = sum(how == "not checked" for result in results for how in result.tables.values())
    reproduced = sum(result.same for result in results)
    say(
        f"{reproduced} of {number_of(len(results), 'run')} reproduced: {number_of(tables, 'table')} with the same bytes",
        style="bold",
    )
    if left:
        say(f"{number_of(left, 'table')} not checked: the raw samples for them are not in the archive", style="dim")
    changes = sorted({change for result in results if result.same for change in result.changed})
    if changes:
        say(f"changed since, without effect on the tables: {', '.join(changes)}", style="dim")
