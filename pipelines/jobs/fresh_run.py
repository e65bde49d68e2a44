"""A second measurement of a run's units by the same recipe on the same station, which no fit has seen."""

from contextlib import suppress
from typing import Any

from pipelines.archive import Archive, Run
from pipelines.jobs.job import ANALYSIS_KEYS, job_of_run, measured_again
from schemas.errors import ArchiveUnusable


def fresh_run_of(archive: Archive, run: Run) -> Run | None:
    """The newest finished run that measured the units again in the same way; None where no run did."""
    if not repeatable(run):
        return None
    about = run.about
    units = tuple(unit["serial"] for unit in about["lot"]["units"])
    wanted, capture = _measurement(about), about["capture"]
    infos = (info for info in reversed(archive.runs()) if info.finished and not info.rerun_of and info.units == units)
    for other in (archive.run(info.id) for info in infos):
        with suppress(ArchiveUnusable, KeyError):  # 'tumbleline verify' says what is wrong with it
            same = _measurement(other.about) == wanted
            if same and other.about["capture"] != capture and not other.about.get("parents"):
                return other
    return None


def repeatable(run: Run) -> bool:
    """Whether a station measured the whole recipe of a run, so that it can do so again."""
    return bool(run.about.get("capture")) and not run.about.get("parents")


def fresh_repeat(archive: Archive, run: Run) -> int:
    """The first count of repeats after the run's whose capture is not finished: one that was begun and stopped goes on.

    Raises WrongUse: the run was imported, or measured only what another run lacked.
    """
    job = job_of_run(run)
    repeat = job.lot.repeat + 1
    while archive.capture(measured_again(job, repeat).capture_id).is_complete():
        repeat += 1
    return repeat


def _measurement(about: dict[str, Any]) -> tuple[Any, ...]:
    """All that determines a measurement except the noise: poses and soaks, station, units and their slots."""
    recipe = {key: value for key, value in about["recipe"].items() if key not in ANALYSIS_KEYS}
    lot = {key: value for key, value in about["lot"].items() if key != "repeat"}
    return recipe, lot, about["station"].get("name")
