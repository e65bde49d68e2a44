"""The fresh run of ``tumbleline improve``: the one that the archive of a run holds, or one that its station measures now."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.archive import Archive, Run
from pipelines.cli.options import error_console

if TYPE_CHECKING:
    from pipelines.jobs.job import Job

CHOICES = "y or Enter measures them, n leaves it; Ctrl-C stops, and the same command continues"


def fresh_run(source: str, archive: str | None, *, measure: bool | None) -> str:
    """The fresh run of a run; empty where there is none and none is measured.

    Parameters
    ----------
    source : a file or a run, as it was named
    measure : whether the station measures one where the archive has none; None: ask at the terminal, else not
    """
    from pipelines.archive import Archive
    from pipelines.importers.files import is_file
    from pipelines.jobs.fresh_run import fresh_run_of, repeatable

    if is_file(source):
        return ""
    store = Archive(archive)
    run = store.run(source)
    fresh = fresh_run_of(store, run)
    if fresh is not None:
        text = f"fresh run: {fresh.id}, the same units measured again"
        error_console().print(text)
        return fresh.id
    if measure is False or not repeatable(run):
        return ""
    return _measured(store, run, ask=measure is None)


def _measured(store: Archive, run: Run, *, ask: bool) -> str:
    from pipelines.cli.terminal import agreed, attended
    from pipelines.jobs.fresh_run import fresh_repeat
    from pipelines.jobs.job import job_of_run, measured_again

    if ask and not attended():
        return ""
    job = measured_again(job_of_run(run), fresh_repeat(store, run))
    question = (
        f"Measure the same {len(job.lot.units)} units again on station {job.station.name} as a fresh run "
        f"({_minutes(job):.0f} min of station time)?"
    )
    if ask and not agreed(question, CHOICES):
        return ""
    from pipelines.cli.run import measured

    return measured(job, store, None, asks=attended() and job.station.kind == "modbus").id


def _minutes(job: Job) -> float:
    """Station time of a job, min."""
    from pipelines.schedule.steps import steps
    from pipelines.schedule.timing import minutes

    return minutes(steps(job.recipe), job.station, job.recipe).total
