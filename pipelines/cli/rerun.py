"""``tumbleline rerun``: archived runs through today's code, another model or other limits."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.options import (
    ArchiveOption,
    DaskOption,
    EffectFileOption,
    JsonOption,
    ModelOption,
    OtherEffectsOption,
    OtherLimitsOption,
    SelectionArgument,
    WorkersOption,
    console,
    error_console,
    print_json,
    print_table,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from pipelines.archive import Archive
    from pipelines.jobs.model_change import ModelChange
    from pipelines.rerun.reproduce import Reproduction
    from pipelines.rerun.rerun import Outcome

PART = "Old data, new models"
ORDER = 520
SUMMARY = "Run archived runs through today's code, another model or other limits."
EXAMPLES = (
    "tumbleline rerun all --check",
    "tumbleline rerun device:adxl355 since:2026-01-01 --model model.toml",
)

SHOWN = 40


def command(
    selection: SelectionArgument,
    effects: OtherEffectsOption = "",
    model: ModelOption = None,
    limits: OtherLimitsOption = "",
    effect_file: EffectFileOption = None,
    archive: ArchiveOption = None,
    dask: DaskOption = "",
    workers: WorkersOption = None,
    *,
    check: Annotated[
        bool, typer.Option("--check", help="Write nothing: prove that every table comes out again, byte for byte.")
    ] = False,
    report: Annotated[bool, typer.Option("--report", help="Draw the report of every re-run, too.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Run archived runs through today's code, another model or other limits: only the stages whose key changed.

    Nothing old is overwritten: where anything changed the result is a new run. What was interrupted goes on. Exit status 1: a run
    could not be run again, or with --check came out otherwise.
    """
    from pipelines.archive import Archive
    from pipelines.jobs.model_change import wanted
    from pipelines.parallel import processors
    from pipelines.rerun.selection import selected

    change = wanted(effects, model, limits, effect_file)
    _refuse_check_of_another(check and bool(effects or model or limits))
    store = Archive(archive)
    runs = [entry.id for entry in selected(store, selection)]
    count = _workers(workers, processors(), runs)
    if check:
        _check(store, runs, change, (dask, count), as_json=as_json)
        return
    from pipelines.rerun.partition import run_again

    outcomes: list[Outcome] = _mapped(run_again, store, runs, (change, dask, count), report=report)
    document = {"archive": str(store.root), "runs": [asdict(one) for one in outcomes], **_counts(outcomes)}
    if as_json:
        print_json(document)
    else:
        _print(outcomes, document)
    raise typer.Exit(1 if document["failed"] else 0)


def _workers(given: int | None, there: int, runs: list[str]) -> int:
    """Processes to work with: a single run is not worth starting one."""
    return max(1, min(given or there, len(runs)))


def _refuse_check_of_another(refused: bool) -> None:
    from schemas.errors import WrongUse

    if refused:
        raise WrongUse(
            "rerun: --check with another model or limits has nothing to compare with; leave --effects, --model and --limits "
            "out, or leave --check out and compare with 'tumbleline diff'"
        )


def _mapped(
    function: Callable[[Any], list[Any]],
    store: Archive,
    runs: list[str],
    how: tuple[ModelChange, str, int],
    *,
    report: bool = False,
) -> list[Any]:
    """What a function makes of the runs, in their order, wherever it is done."""
    from pathlib import Path as LocalPath

    from pipelines.flows.spread import on_dask
    from pipelines.parallel import map_partitions
    from pipelines.rerun.partition import parts

    change, dask, count = how
    home = store.root.resolve() / "orchestrator" if isinstance(store.root, LocalPath) else None
    with error_console().status(f"running {len(runs)} runs again, {count} at a time"):
        portions = parts(store, runs, change, count, report=report)
        done = map_partitions(
            function, portions, on_dask(dask, count, home), workers=count, name=f"rerun of {len(runs)} runs"
        )
    return [one for portion in done for one in portion]


def _counts(outcomes: list[Outcome]) -> dict[str, int]:
    failed = sum(bool(one.error) for one in outcomes)
    anew = sum(bool(one.new) and one.new != one.run for one in outcomes)
    return {"selected": len(outcomes), "rerun": anew, "unchanged": len(outcomes) - anew - failed, "failed": failed}


def _print(outcomes: list[Outcome], document: dict[str, Any]) -> None:
    lines = [_line(one) for one in outcomes[:SHOWN] if not one.error]
    if lines:
        print_table(["run", "re-run", "changed", "stages worked out"], lines, whole=2)
    out = console()
    if len(outcomes) > SHOWN:
        out.print(f"… and {len(outcomes) - SHOWN} more; --json names them all", style="dim")
    for one in outcomes:
        if one.error:
            out.print(f"  {one.run}: {one.error}", style="bold red", markup=False, soft_wrap=True)
    out.print(
        f"{document['selected']} selected: {document['rerun']} run again, {document['unchanged']} unchanged, "
        f"{document['failed']} could not be run again"
    )
    if document["rerun"]:
        out.print("what moved: tumbleline diff RUN RE-RUN", style="dim", markup=False)


def _line(one: Outcome) -> list[str]:
    whats = dict.fromkeys("code" if change["what"] == "code" else change["what"] for change in one.because)
    worked = [name for name, how in one.stages.items() if how == "computed"]
    return [one.run, one.new if one.new != one.run else "—", ", ".join(whats) or "nothing", ", ".join(worked) or "none"]


def _check(store: Archive, runs: list[str], change: ModelChange, how: tuple[str, int], *, as_json: bool) -> None:
    from pipelines.rerun.partition import checked

    found: list[Reproduction] = _mapped(checked, store, runs, (change, *how))
    differ = [one for one in found if not one.same]
    document = {
        "archive": str(store.root),
        "selected": len(found),
        "same": len(found) - len(differ),
        "runs": [{**asdict(one), "same": one.same} for one in found],
    }
    if as_json:
        print_json(document)
    else:
        _print_check(found)
    raise typer.Exit(1 if differ else 0)


def _print_check(found: list[Reproduction]) -> None:
    out = console()
    tables = 0
    for one in found:
        tables += sum(how == "same bytes" for how in one.tables.values())
        for line in [one.error] if one.error else one.differences:
            out.print(f"  {one.run}: {line}", style="bold red", markup=False, soft_wrap=True)
        if one.differences:
            why = ", ".join(one.changed) or "neither the code nor a library: the machine, or the stored file"
            out.print(f"    changed since: {why}", markup=False, soft_wrap=True)
    left = sum(how == "not checked" for one in found for how in one.tables.values())
    same = sum(one.same for one in found)
    out.print(f"{same} of {len(found)} runs come out again: {tables} tables with the same bytes", style="bold")
    if left:
        out.print(
            f"{left} tables not checked: the raw samples that they were made from are not in the archive", style="dim"
        )
    told = sorted({change for one in found if one.same for change in one.changed})
    if told:
        out.print(f"changed since, without moving a byte: {', '.join(told)}", style="dim", markup=False, soft_wrap=True)
