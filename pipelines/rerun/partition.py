"""Batches of the runs of an archive for workers; their arguments and results are plain values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from inertial.errors import InertialError
from pipelines.archive import Archive
from pipelines.jobs.model_change import ModelChange
from pipelines.rerun.reproduce import Reproduction, check
from pipelines.rerun.rerun import RerunOutcome, again
from schemas.errors import TumblelineError

MOST = 32  # runs in a batch; the work of one batch is lost when a worker dies


@dataclass(frozen=True)
class Batch:
    """Some runs of an archive, and the change for their re-run."""

    archive: str
    runs: tuple[str, ...]
    change: ModelChange = field(default_factory=ModelChange)
    report: bool = False


def parts(
    archive: Archive, runs: Sequence[str], change: ModelChange, workers: int, *, report: bool = False
) -> list[Batch]:
    """The runs in batches, several for each worker; equal runs give equal batches."""
    size = min(MOST, max(1, -(-len(runs) // (4 * max(workers, 1)))))
    batches = [tuple(runs[start : start + size]) for start in range(0, len(runs), size)]
    return [Batch(archive.address, batch, change, report) for batch in batches]


def run_again(part: Batch) -> list[RerunOutcome]:
    """The outcome of every run of a batch."""
    return _each(part, partial(again, change=part.change, report=part.report), RerunOutcome)


def checked(part: Batch) -> list[Reproduction]:
    """Whether every run of a batch is reproduced."""
    return _each(part, check, Reproduction)


Result = TypeVar("Result")


def _each(part: Batch, call: Callable[[Archive, str], Result], failed: Callable[..., Result]) -> list[Result]:
    """The results of a call for every run of a batch; a run that fails gives an error, the others continue."""
    archive, results = Archive(part.archive), list[Result]()
    for run_id in part.runs:
        try:
            results.append(call(archive, run_id))
        except (TumblelineError, InertialError) as problem:
            results.append(failed(run_id, error=str(problem)))
    return results
