"""One run of the archive again: only the stages whose key changed, into a new run; the old run is not changed."""

import time
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any

from threadpoolctl import ThreadpoolController

from pipelines.archive import Archive, Run, files, stage_key
from pipelines.archive.buffered_run import BufferedRun
from pipelines.archive.locks import alone
from pipelines.archive.provenance import provenance
from pipelines.archive.run import START
from pipelines.chain.chain import RECORDS
from pipelines.jobs.model_change import ModelChange
from pipelines.rerun.steps import FROM_SAMPLES, Plan, StageCall, plan_of
from pipelines.tables.leave_out import Dwells
from schemas.errors import DataRejected

THERE, TAKEN, KEPT, COMPUTED = "there", "taken over", "kept", "computed"
"""What became of a stage: in the new run already; from the old run, whose key is the same; from the old run, because the raw
samples it reads are not in the archive; worked out."""


@dataclass(frozen=True)
class RerunOutcome:
    """The outcome of one run, also in the JSON document: its re-run, what had changed, and how every stage came about."""

    run: str
    new: Annotated[str, "id of the re-run; the run's own if nothing changed, empty if it failed"] = ""
    because: Annotated[list[dict[str, str]], "what changed: data, model, limits, code, library"] = field(
        default_factory=list
    )
    stages: Annotated[dict[str, str], "`computed` or `reused` by stage"] = field(default_factory=dict)
    seconds: float = 0.0
    error: str = ""


def again(
    archive: Archive, run_id: str, change: ModelChange, *, report: bool = False, left_out: Dwells = ()
) -> RerunOutcome:
    """Run an archived run again. A new run is published when all of it is there: a run that fails or is stopped leaves nothing.

    Raises DataRejected: the run cannot be run again: its capture is not finished, or samples are needed that are not in the
        archive.
    """
    start = time.perf_counter()
    change.use()
    old = Run(archive, run_id)
    plan = plan_of(old, change, left_out)
    raw = raw_samples(old)
    because = changes(old, plan, raw=raw)
    new = BufferedRun(archive, archive.run_name(plan.name, plan.decisive) if because else old.id)
    with _libraries().limit(limits=1):
        if (new.path / START).is_file():
            with alone(new.path, wait=True):
                files.sweep(new.path)
                try:
                    stages = _done(old, new, plan, raw=raw)
                finally:
                    new.flush()  # a run that was there goes on behind the last stage that was done
        else:
            archive.prepare()
            new.begin({**provenance(), **plan.about, **old.origin, "because": because})
            stages = _done(old, new, plan, raw=raw)
            with alone(new.path, wait=True):
                files.sweep(new.path)
                if (new.path / START).is_file():  # another process made this run meanwhile, with the same bytes
                    new.forget()
                new.flush(last=START)
        with alone(new.path, wait=True):
            if report and new.about.get("capture"):
                from pipelines.report import make_report  # plots are slow to import

                stages["report"] = THERE if make_report(new) else COMPUTED
            if new.id != old.id or COMPUTED in stages.values():
                new.seal()
    return RerunOutcome(old.id, new.id, because, stages, time.perf_counter() - start)


def _done(old: Run, new: BufferedRun, plan: Plan, *, raw: bool) -> dict[str, str]:
    """The outcome of every stage (computed, reused or kept), by name."""
    work = StageRunner(old, new, raw=raw)
    return {step.name: work.do(step) for step in plan.steps}


@cache
def _libraries() -> ThreadpoolController:
    """The libraries of this process that work in threads; to find them takes longer than a table."""
    return ThreadpoolController()


def raw_samples(run: Run) -> bool:
    """Whether what was captured for a run is in the archive.

    Raises DataRejected: it is, in part: its capture is not finished.
    """
    records = run.records
    if records is None or records.is_complete():
        return records is not None
    if records.finished():
        raise DataRejected(
            f"run {run.id}: its capture has {len(records.finished())} records and is not finished, all are needed; give its "
            "'tumbleline run' again and it goes on"
        )
    return False


def has_static_record(run: Run) -> bool:
    """Whether a run has a static record, whose samples its noise is made from."""
    return bool((run.table("readings")["kind"] == "allan").any())


def changes(old: Run, plan: Plan, *, raw: bool) -> list[dict[str, str]]:
    """The differences of a re-run from the run: by stage, ``code``, ``model``, ``limits`` or another parameter.

    raw : whether the raw samples are there; without them the tables of the stages that read them are reused
    """
    rows: list[dict[str, str]] = []
    there = set(old.tables())
    for step in plan.steps:
        if step.name == "leave_out":
            named = ", ".join(f"{unit}:{dwell}" for unit, dwell in step.parameters["left_out"])
            rows.append(_change(step.name, "dwells left out", "", named))
            continue
        given = step.name in {"capture", "import"} or (step.name in FROM_SAMPLES and not raw)
        if given or not there.issuperset(step.outputs):
            continue
        manifest = old.manifest(step.outputs[0])
        if manifest.get("code") != step.code:
            rows.append(_change(step.name, "code", str(manifest.get("code", "")), step.code))
        before = manifest.get("parameters", {})
        rows += [
            _change(step.name, PARAMETER_TITLES.get(key, key), _short_text(before[key]), _short_text(value))
            for key, value in step.parameters.items()
            if key in before and before[key] != value
        ]
    planned = {name for step in plan.steps for name in step.outputs}
    if there >= {"dwells"} and not planned <= there and not old.about.get("capture"):
        rows.append(_change("fit", "not fitted yet", "", ""))
    return rows


PARAMETER_TITLES = {"effects": "model", "formulas": "model"}


def _change(stage: str, what: str, before: str, after: str) -> dict[str, str]:
    return {"stage": stage, "what": what, "from": before, "to": after}


def _short_text(value: Any) -> str:
    if isinstance(value, dict):
        return str(value.get("name", "")) or "…"
    items = value if isinstance(value, list) else [value]
    return ", ".join(str(item.get("id", "") if isinstance(item, dict) else item) for item in items)


class StageRunner:
    """The stages of one run, each there, taken over or worked out."""

    def __init__(self, old: Run, new: Run, *, raw: bool) -> None:
        self.old, self.new, self.raw = old, new, raw
        self._records = ""
        self._before = set(old.tables())

    def do(self, step: StageCall) -> str:
        """Run or reuse a stage, so that its outputs are in the new run; return its outcome."""
        if step.name == "import" or (step.name in {"capture", *FROM_SAMPLES} and not self.raw):
            return self._keep(step)
        inputs = {name: self._hash(name) for name in step.inputs}
        key = stage_key(step.name, inputs, step.parameters, step.code)
        if self.new.has(step.outputs, key):
            return THERE
        if self.new.id != self.old.id and self.old.has(step.outputs, key):
            self.new.adopt(self.old, step.outputs)
            return TAKEN
        self._refuse_without_samples(step)
        about = {"inputs": inputs, "parameters": step.parameters, "code": step.code}
        self.new.save(step.name, key, step.call(self.new), about)
        return COMPUTED

    def _keep(self, step: StageCall) -> str:
        if not self._before.issuperset(step.outputs):
            missing = ", ".join(name for name in step.outputs if name not in self._before)
            raise DataRejected(
                f"run {self.old.id}: neither {missing} nor the raw samples are in the archive, one of the two is needed; "
                "bring the capture's folder back"
            )
        if self.new.id == self.old.id or set(self.new.tables()).issuperset(step.outputs):
            return THERE
        self.new.adopt(self.old, step.outputs)
        return TAKEN if step.name in {"capture", "import"} else KEPT

    def _hash(self, name: str) -> str:
        if name != RECORDS:
            return self.new.manifest(name)["sha256"]
        if not self._records:  # a lot has a hundred records
            records, before = self.old.records, {}
            if not self.raw and "noise" in self._before:
                before = self.old.manifest("noise").get("inputs", {})
            self._records = before.get(RECORDS) or ("" if records is None else records.hash())
        return self._records

    def _refuse_without_samples(self, step: StageCall) -> None:
        if step.name == "noise" and not self.raw and has_static_record(self.new):
            raise DataRejected(
                f"run {self.old.id}: its static record is not in the archive, the noise under other coefficients needs it; "
                "bring the capture's folder back"
            )
