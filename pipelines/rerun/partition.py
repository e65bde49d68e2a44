"""Portions of an archive's runs for workers: what each is given, does, and gives back are plain values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from inertial.errors import InertialError
from pipelines.archive import Archive
from pipelines.jobs.model_change import ModelChange
from pipelines.rerun.reproduce import Reproduction, check
from pipelines.rerun.rerun import Outcome, again
from schemas.errors import TumblelineError

if TYPE_CHECKING:
    from collections.abc import Sequence

MOST = 32
"""Runs in a portion: a worker that dies loses the time of no more."""


@dataclass(frozen=True)
class Batch:
    """Some runs of an archive, and what is to be done to them."""

    archive: str
    runs: tuple[str, ...]
    wanted: ModelChange = field(default_factory=ModelChange)
    report: bool = False


def parts(
    archive: Archive, runs: Sequence[str], wanted: ModelChange, workers: int, *, report: bool = False
) -> list[Batch]:
    """The runs in portions, several for each worker, the same for the same runs."""
    size = min(MOST, max(1, -(-len(runs) // (4 * max(workers, 1)))))
    portions = [tuple(runs[start : start + size]) for start in range(0, len(runs), size)]
    return [Batch(archive.address, portion, wanted, report) for portion in portions]


def run_again(part: Batch) -> list[Outcome]:
    """What became of every run of a portion; what cannot be run again says why, and the others go on."""
    archive = Archive(part.archive)
    return [_one(archive, run_id, part) for run_id in part.runs]


def _one(archive: Archive, run_id: str, part: Batch) -> Outcome:
    try:
        return again(archive, run_id, part.wanted, report=part.report)
    except (TumblelineError, InertialError) as problem:
        return Outcome(run_id, error=str(problem))


def checked(part: Batch) -> list[Reproduction]:
    """Whether every run of a portion comes out the same again."""
    archive = Archive(part.archive)
    return [_check(archive, run_id) for run_id in part.runs]


def _check(archive: Archive, run_id: str) -> Reproduction:
    try:
        return check(archive, run_id)
    except (TumblelineError, InertialError) as problem:
        return Reproduction(run_id, error=str(problem))
