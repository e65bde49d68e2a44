"""The runner: for each stage it loads, hashes, calls, checks and saves; a stage whose key is there is not run again.

That is going on after a crash and running an archive again, by one mechanism.
"""

import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from threadpoolctl import threadpool_limits

from pipelines.archive import Archive, Records, Run, code_hash, files, stage_key
from pipelines.archive.locks import alone
from pipelines.archive.run import SEALED, START
from pipelines.chain.chain import BY_NAME, ORDER, RECORDS, Stage
from pipelines.jobs.job import Job
from schemas.progress import Progress, silent


@dataclass(frozen=True)
class Done:
    """The result of a stage: whether its output was there already, and its duration, s."""

    stage: str
    reused: bool
    seconds: float


Measure = Callable[["Job", "Records", "Progress"], None]


def from_station(job: Job, records: Records, progress: Progress, before: Records | None = None) -> None:
    """Measure a job's lot on its station, going on behind the last record that is stored, or from the end of another capture."""
    from pipelines.capture.capture import capture  # a re-run of archived data opens no station
    from pipelines.chain.looks import LotLooks
    from pipelines.procedures import roles_of
    from stations import open_station

    run = f"{job.recipe.name} {job.capture_id}"
    roles = roles_of(job.recipe)
    state = records.last_state() or (None if before is None else before.last_state())
    with open_station(job.station, job.lot, resume=state, run=run, roles=roles) as station:
        terms = job.recipe.stop
        looks = None if terms is None else LotLooks(job, terms, records)
        capture(station, job.recipe, job.lot, records, progress=progress, events=records.events, looks=looks)


def captured_tables(records: Records) -> dict[str, pd.DataFrame]:
    """The tables of a run from its capture, without samples: readings, temperatures against time, soaks, events."""
    tables = {"events": records.events.table(), "soaks": records.events.soaks()}
    return {**tables, **{name: records.gathered(name) for name in ("readings", "history")}}


def decisive(job: Job) -> dict[str, Any]:
    """Everything that the result of a job depends on; not the report, which only shows it and may be made again."""
    code = {stage.name: code_hash(stage.name) for stage in BY_NAME.values()}
    about = {key: value for key, value in job.about.items() if key != "station"}
    return {**about, "code": code}


def _origin(job: Job, archive: Archive) -> dict[str, str]:
    """The run that measured the data of a job, where the capture is complete already: the new run is then a re-analysis."""
    if not archive.capture(job.capture_id).is_complete():
        return {}
    first = archive.first_run_of(job.capture_id, [unit.serial for unit in job.lot.units])
    return {} if first is None else first.origin


class Runner:
    """The chain for one job in one archive."""

    def __init__(
        self, job: Job, archive: Archive, progress: Progress = silent, measure: Measure = from_station
    ) -> None:
        self.job, self.archive, self.progress, self.measure = job, archive, progress, measure
        name = archive.run_name(job.recipe.name, content := decisive(job))
        self._was_there = (archive.root / "runs" / name / START).is_file()
        origin = {} if self._was_there else _origin(job, archive)
        self.run: Run = archive.open_run(job.recipe.name, {**job.about, **origin}, content)

    def all(self) -> Iterator[Done]:
        """Every stage, in order, as it is done."""
        for name in ORDER:
            yield self.stage(name)

    def full_plan(self) -> "Runner | None":
        """The full plan, from where the station stands, where a fitted unit or the lot does not fit the family; else None.

        A plan that a prior has shortened misses its required errors where that prior is widened for the lot.

        The whole lot goes through it: table and chamber need the same time for one unit.
        """
        if self.job.full is None:
            return None
        prior = self.run.table("prior")
        if prior["fits"].all() and not (prior["widened"] > 1.0).any():
            return None
        before = self.archive.capture(self.job.capture_id)
        return Runner(self.job.full, self.archive, self.progress, partial(from_station, before=before))

    def abandon(self) -> None:
        """Remove the run of a re-fit that failed: its capture stays, and no run without results becomes the latest."""
        if self._was_there or (self.run.path / SEALED).is_file():
            return
        with alone(self.run.path, wait=True):
            if isinstance(self.run.path, Path):
                shutil.rmtree(self.run.path)
            else:
                self.run.path.remove_all()

    def stage(self, name: str) -> Done:
        """Do one stage, or find it done."""
        start = time.perf_counter()
        with threadpool_limits(1):
            if name == "capture":
                reused = self._capture()
            else:
                with alone(self.run.path, wait=True):
                    files.sweep(self.run.path)
                    reused = self._report() if name == "report" else self._compute(BY_NAME[name])
        return Done(name, reused, time.perf_counter() - start)

    def _capture(self) -> bool:
        records = self.archive.capture(self.job.capture_id)
        was_there = records.is_complete()
        if not was_there:
            with alone(records.path):
                records.begin()
                self.measure(self.job, records, self.progress)
                records.complete()
        inputs = {RECORDS: records.hash()}
        parameters = {"capture": self.job.capture_id}
        about = {"inputs": inputs, "parameters": parameters, "code": ""}
        key = stage_key("capture", inputs, parameters, "")
        with alone(self.run.path, wait=True):
            if not self.run.has(("readings", "history"), key):
                self.run.save("capture", key, captured_tables(records), about)
        return was_there

    def _compute(self, stage: Stage) -> bool:
        inputs, parameters, code = self._inputs(stage.inputs), stage.parameters(self.job), code_hash(stage.name)
        key = stage_key(stage.name, inputs, parameters, code)
        if self.run.has(stage.outputs, key):
            return True
        about = {"inputs": inputs, "parameters": parameters, "code": code}
        self.run.save(stage.name, key, stage.call(self.job, self.run), about)
        return False

    def _report(self) -> bool:
        from pipelines.report import make_report  # plots are slow to import

        return make_report(self.run)

    def _inputs(self, names: tuple[str, ...]) -> dict[str, str]:
        return {
            name: self.archive.capture(self.job.capture_id).hash()
            if name == RECORDS
            else self.run.manifest(name)["sha256"]
            for name in names
        }
