"""``tumbleline run``: the main job, from recipe to report."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import Archive, Run
from pipelines.cli import options
from pipelines.cli.options import option
from pipelines.cli.printing import conclude, error_console, remark
from schemas.errors import WrongUse
from schemas.progress import Progress

if TYPE_CHECKING:
    from pipelines.chain.runner import Done
    from pipelines.jobs.job import Job, Request

PART = "Start here"
ORDER = 10
SUMMARY = "Measure and calibrate a lot, from recipe to report: the main job."
EXAMPLES = (
    "tumbleline run my.toml --units SN1,SN2,SN3",
    "tumbleline run my.toml --station line-1.toml --units lot-17.csv",
)


def command(
    recipe: options.RecipeArgument = "production",
    station: options.StationOption = None,
    units: Annotated[
        str,
        option(
            "--units SN,…|FILE|scan",
            "Serial numbers in the order of the slots, a slot map (CSV or TOML), or 'scan' to scan them.",
        ),
    ] = "",
    archive: options.ArchiveOption = None,
    seed: options.SeedOption = None,
    repeat: options.RepeatOption = 0,
    fault: Annotated[
        list[str] | None, option("--fault KIND[:KEY=VALUE…]", "Fault of the simulated station; may be repeated.")
    ] = None,
    *,
    yes: Annotated[
        bool | None,
        option(
            "--yes/--ask",
            "Run without an operator, or ask them to load and unload; default: ask on hardware, at a terminal.",
        ),
    ] = None,
    record: options.RecordOption = None,
    replay: Annotated[
        Path | None, option("--replay FILE", "Answer from this recording of the same run; no station is opened.")
    ] = None,
    direct: Annotated[bool, option("--direct", "Run without the Prefect server; the results are the same.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Measure and calibrate a lot, from recipe to report: the main job.

    Given again after a stop, the same command continues the run; given again after the end, it measures nothing and shows the
    result. RECIPE may be run:RUN: the units of an archived run are measured again as they were, with --repeat 1, 2, … as fresh
    measurements. A lot that is larger than the fixture is measured in several fillings, if an operator at the terminal seats the
    units.
    """
    from pipelines.certificates.coefficient_remarks import library_remarks
    from pipelines.certificates.days import today
    from pipelines.chain.certifiable import overdue
    from pipelines.cli.next_commands import print_next
    from pipelines.cli.summary import all_passed, print_result, summary
    from pipelines.cli.terminal import attended, scanned
    from pipelines.cli.text.verdict_text import judged
    from pipelines.jobs.job import OF_RUN, Request
    from pipelines.jobs.seating import SCAN, read_seating
    from schemas.station import load_station
    from stations.links.recorder import recorded
    from stations.recordings.held import held_to

    slots = 0 if recipe.startswith(OF_RUN) else load_station(station).devices.slots.count
    seating = scanned(slots) if units == SCAN else read_seating(units)
    request_of_lot = Request(recipe, station, seating.units, seating.slots, seed, repeat, tuple(fault or ()))
    asks = not yes if yes is not None else attended() and not as_json
    requests = request_of_lot.fillings(slots) if asks else [request_of_lot]
    jobs = [request.job(Archive(archive)) for request in requests]
    begins = not Archive(archive).capture(jobs[0].capture_id).is_complete()
    if begins and (late := overdue(jobs[0].station.model_dump(mode="json"), today())):
        remark(f"run: no certificate can be issued for this lot: {late}")
    asks = asks and (yes is False or len(requests) > 1 or jobs[0].station.kind == "modbus")
    if record is not None or replay is not None:
        refuse_recorded(jobs, Archive(archive), replays=replay is not None)
        direct, asks = True, asks and replay is None
    with recorded(record, f"run of {jobs[0].recipe.name}"), held_to(replay) as held:
        runs = [
            measured(job, Archive(archive), None if direct else request, asks=asks)
            for request, job in zip(requests, jobs, strict=True)
        ]
    if held is not None and held.left:
        remark(f"replay: {held.left} recorded exchanges were not asked for: the recorded run went on")
    for line in (line for run in runs for line in library_remarks(run)):
        remark(f"run: {line}")
    documents = [judged(summary(run), run) for run in runs]

    def show(_: object) -> None:
        for document in documents:
            print_result(document)
        lines = [_next(run, document, archive) for run, document in zip(runs, documents, strict=True)]
        print_next([*chain.from_iterable(lines)])

    result = documents[0] if len(documents) == 1 else {"fillings": documents}
    conclude(result, show, as_json=as_json, passed=all(map(all_passed, documents)))


def refuse_recorded(jobs: list[Job], store: Archive, *, replays: bool) -> None:
    """Refuse to record or replay a lot that the archive has already: nothing would be measured.

    Raises WrongUse: its capture is there, whole or in part.
    """
    for job in jobs:
        capture = store.capture(job.capture_id)
        if capture.is_complete() or capture.last_state():
            word = "replay" if replays else "record"
            raise WrongUse(
                f"run: --{word}, the archive {store.root} has measurements of this lot already ({job.capture_id}), a fresh one "
                "is needed; name another --archive, or count it with --repeat"
            )


def _next(run: Run, document: dict[str, Any], archive: str | None) -> list[str]:
    """The commands after a run: what its model lacks or its plan cannot show, and its certificates where they can be given."""
    from pipelines.certificates import Ledger
    from pipelines.chain.certify import offered
    from pipelines.cli.next_commands import archive_words, command_line

    words = [run.id, *archive_words(archive)]
    lines = [command_line("diagnose", *words)] if document["adequacy"] is not None else []
    issues = offered(Ledger(run.archive.root), run)
    return [*lines, command_line("certificate", "issue", *words)] if issues else lines


def measured(job: Job, store: Archive, request: Request | None, *, asks: bool) -> Run:
    """The run of one filling of the fixture; by the orchestrator where its request is given, else without."""
    from pipelines.audit.index_growth import add_runs
    from pipelines.chain.attendance import JUDGED, Attendance
    from pipelines.chain.runner import Runner
    from pipelines.cli.terminal import Terminal

    with shown() as (progress, report_stage, quiet):
        operator = Terminal(quiet) if asks else None
        if request is not None:
            from pipelines.flows.local import run_locally

            return run_locally(request, job, store, progress, report_stage, operator)
        runner = Runner(job, store, progress)
        beside = None if operator is None else Attendance(operator, job, runner.run.id)
        if beside is not None:
            report_stage(beside.capture(runner, lambda: runner.stage("capture")))
        for done in runner.all():
            report_stage(done)
            if done.stage == "fit" and (full := runner.full_plan()) is not None:
                remark(f"run: lot or unit does not fit the family; run {full.run.id} goes on with the full plan")
                for other in full.all():
                    report_stage(other)
            if beside is not None and done.stage == JUDGED:
                beside.unload(runner.run)
        add_runs(store, [runner.run.id])
        return runner.run


DOES = {
    "validate": "checking the records",
    "reduce": "averaging the dwells",
    "fit": "fitting the models",
    "verify": "comparing with the poses that no fit uses",
    "noise": "computing the Allan deviations",
    "soak_noise": "comparing the noise of the soaks",
    "budget": "computing the uncertainties",
    "procedures": "evaluating the procedures",
    "grade": "deciding by the limits",
    "report": "drawing the report",
}
"""The action of each stage, for the progress line."""


@contextmanager
def shown() -> Generator[tuple[Progress, Callable[[Done], None], Callable[[], AbstractContextManager[None]]]]:
    """A progress bar for the capture and a line for each stage, on standard error; and a context that pauses both."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.table import Column

    out = error_console()
    stages = list(DOES)
    words = TextColumn("{task.description}", table_column=Column(no_wrap=False))  # wraps where the terminal is narrow
    columns = (BarColumn(bar_width=12), MofNCompleteColumn(), TimeElapsedColumn(), words)
    with Progress(*columns, console=out, transient=True) as bars:
        bar = bars.add_task("preparing", total=None)

        def progress(done: int, total: int, note: str) -> None:
            bars.update(bar, completed=done, total=total, description=note)

        def report_stage(done: Done) -> None:
            how = "reused" if done.reused else f"{done.seconds:.1f} s"
            bars.console.print(f"{done.stage:<10} {how}")
            at = stages.index(done.stage) + 1 if done.stage in DOES else 0
            note = DOES[stages[at]] if at < len(stages) else "finishing"
            bars.update(bar, description=note, completed=at, total=len(stages))

        @contextmanager
        def quiet() -> Generator[None]:
            bars.stop()
            try:
                yield
            finally:
                bars.start()

        yield progress, report_stage, quiet
