"""``tumbleline rerun``: re-analysis of archived runs with the present code, another model or other limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli import options
from pipelines.cli.printing import error_console, give, print_table, say

if TYPE_CHECKING:
    from pipelines.jobs.model_change import ModelChange
    from pipelines.rerun.reproduce import Reproduction
    from pipelines.rerun.rerun import RerunOutcome

PART = "Old data, new models"
ORDER = 520
SUMMARY = "Re-analyse archived runs with the present code, another model or other limits."
EXAMPLES = (
    "tumbleline rerun all --check",
    "tumbleline rerun device:adxl355 since:2026-01-01 --model model.toml",
)

SHOWN = 40


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
        bool, typer.Option("--check", help="Write nothing; check that every table is reproduced byte for byte.")
    ] = False,
    report: Annotated[bool, typer.Option("--report", help="Also make the report of every re-run.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Re-analyse archived runs with the present code, another model or other limits; only stages with a changed key are computed.

    Old runs are never overwritten: a changed result is a new run. After an interruption, give the same command again to continue.
    Exit status 1: a run could not be re-analysed, or with --check was not reproduced.
    """
    from pipelines.jobs.model_change import change_from_options
    from pipelines.parallel import processors
    from pipelines.rerun.selection import selected

    change = change_from_options(effects, model, limits, effect_file)
    _refuse_check_of_another(check and bool(effects or model or limits))
    store = Archive(archive)
    runs = [entry.id for entry in selected(store, selection)]
    count = _workers(workers, processors(), runs)
    if check:
        _check(store, runs, change, (dask, count), as_json=as_json)
        return
    from pipelines.audit.index_growth import add_runs
    from pipelines.rerun.partition import run_again

    outcomes: list[RerunOutcome] = _mapped(run_again, store, runs, (change, dask, count), report=report)
    add_runs(store, [one.new for one in outcomes if one.new])
    document = {"archive": str(store.root), "runs": [asdict(one) for one in outcomes], **_counts(outcomes)}
    give(document, lambda _: _print(outcomes, document, archive), as_json=as_json)
    raise typer.Exit(1 if document["failed"] else 0)


def _workers(given: int | None, there: int, runs: list[str]) -> int:
    """Number of processes, at most one for each run."""
    return max(1, min(given or there, len(runs)))


def _refuse_check_of_another(refused: bool) -> None:
    from schemas.errors import WrongUse

    if refused:
        raise WrongUse(
            "rerun: --check with another model or limits has no stored result to compare with; leave --effects, --model and "
            "--limits out, or leave --check out and compare with 'tumbleline diff'"
        )


def _mapped(
    function: Callable[[Any], list[Any]],
    store: Archive,
    runs: list[str],
    how: tuple[ModelChange, str, int],
    *,
    report: bool = False,
) -> list[Any]:
    """Results of a function for the runs, in their order, computed here or on a cluster."""
    from pathlib import Path as LocalPath

    from pipelines.flows.dask_cluster import on_dask
    from pipelines.parallel import map_partitions
    from pipelines.rerun.partition import parts

    change, dask, count = how
    home = store.root.resolve() / "orchestrator" if isinstance(store.root, LocalPath) else None
    with error_console().status(f"re-analysing {number_of(len(runs), 'run')}, {count} at a time"):
        portions = parts(store, runs, change, count, report=report)
        done = map_partitions(
            function,
            portions,
            on_dask(dask, count, home),
            workers=count,
            name=f"rerun of {number_of(len(runs), 'run')}",
        )
    return [one for portion in done for one in portion]


def _counts(outcomes: list[RerunOutcome]) -> dict[str, int]:
    failed = sum(bool(one.error) for one in outcomes)
    anew = sum(bool(one.new) and one.new != one.run for one in outcomes)
    return {"selected": len(outcomes), "rerun": anew, "unchanged": len(outcomes) - anew - failed, "failed": failed}


DIFFERENCES = 3  # re-runs that are proposed for a comparison


def _print(outcomes: list[RerunOutcome], document: dict[str, Any], archive: str | None) -> None:
    lines = [_line(one) for one in outcomes[:SHOWN] if not one.error]
    if lines:
        print_table(["run", "re-run", "changed", "stages computed"], lines, whole=2)
    if len(outcomes) > SHOWN:
        say(f"… and {len(outcomes) - SHOWN} more; --json lists all", style="dim")
    for one in outcomes:
        if one.error:
            say(f"  {one.run}: {one.error}", style="bold red")
    say(
        f"{document['selected']} selected: {document['rerun']} re-analysed, {document['unchanged']} unchanged, "
        f"{document['failed']} failed"
    )
    from pipelines.cli.next_commands import archive_words, command_line, print_next

    anew = [one for one in outcomes if one.new and one.new != one.run and not one.error]
    print_next([command_line("diff", one.run, one.new, *archive_words(archive)) for one in anew[:DIFFERENCES]])


def _line(one: RerunOutcome) -> list[str]:
    whats = dict.fromkeys("code" if change["what"] == "code" else change["what"] for change in one.because)
    worked = [name for name, how in one.stages.items() if how == "computed"]
    return [one.run, one.new if one.new != one.run else "—", ", ".join(whats) or "nothing", ", ".join(worked) or "none"]


def _check(store: Archive, runs: list[str], change: ModelChange, how: tuple[str, int], *, as_json: bool) -> None:
    from pipelines.rerun.partition import checked

    results: list[Reproduction] = _mapped(checked, store, runs, (change, *how))
    differ = [one for one in results if not one.same]
    document = {
        "archive": str(store.root),
        "selected": len(results),
        "same": len(results) - len(differ),
        "runs": [{**asdict(one), "same": one.same} for one in results],
    }
    give(document, lambda _: _print_check(results), as_json=as_json)
    raise typer.Exit(1 if differ else 0)


def _print_check(results: list[Reproduction]) -> None:
    tables = 0
    for one in results:
        tables += sum(how == "same bytes" for how in one.tables.values())
        for line in [one.error] if one.error else one.differences:
            say(f"  {one.run}: {line}", style="bold red")
        if one.differences:
            why = (
                ", ".join(one.changed)
                or "neither code nor libraries; the computer differs or the stored file is damaged"
            )
            say(f"    changed since: {why}")
    left = sum(how == "not checked" for one in results for how in one.tables.values())
    same = sum(one.same for one in results)
    say(
        f"{same} of {number_of(len(results), 'run')} reproduced: {number_of(tables, 'table')} with the same bytes",
        style="bold",
    )
    if left:
        say(f"{number_of(left, 'table')} not checked: the raw samples for them are not in the archive", style="dim")
    changes = sorted({change for one in results if one.same for change in one.changed})
    if changes:
        say(
            f"changed since, without effect on the tables: {', '.join(changes)}",
            style="dim",
        )
