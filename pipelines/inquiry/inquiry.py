"""The inquiry of one lot: what is known from all measurements so far, and what is to be measured next, or why nothing is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from threadpoolctl import threadpool_limits

from pipelines.archive import code_hash, files, stage_key
from pipelines.chain.runner import Runner
from pipelines.diagnosis.diagnose import document, examined
from pipelines.diagnosis.next_measurement import Proposed, proposed, rows_of
from pipelines.inquiry.explanation import shows, why
from pipelines.inquiry.followup import circumstances, follow_up
from pipelines.inquiry.lineage import RunSequence
from pipelines.jobs.job import Job
from schemas.recipe import Recipe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from inertial.criticism.diagnosis import Diagnosis
    from inertial.criticism.proposals import Proposal
    from inertial.planning.sequences import SequenceStep
    from inertial.state import State
    from pipelines.archive import Archive, Records, Run
    from pipelines.tables.dwells import Measured
    from schemas.progress import Progress

End = Literal["adequate", "told_apart", "nothing_parts", "budget", "declined", "asked", "blocked", "unexplained"]

EXTRA = 0.3
"""Share of the first run's station time that follow-ups may take where no budget is given."""

MOST_ROUNDS = 6
FOLLOW_UP = ("capture", "validate", "reduce")
TABLE_OF_CODE = ("inertial", "pipelines.diagnosis.diagnose", "pipelines.tables.dwells")
FILE = "inquiry.json"


@dataclass(frozen=True)
class JointDiagnosis:
    """The diagnosis of all measurements of a lineage together."""

    lineage: RunSequence
    effects: tuple[str, ...]
    document: dict[str, Any]
    found: Measured
    diagnosis: Diagnosis | None
    following: Proposed

    @property
    def state(self) -> State:
        """The dwells that physics was looked for in."""
        if self.diagnosis is None:
            raise LookupError("an inquiry in which every unit has a data fault has no state")
        return self.diagnosis.problem.lot.state

    @property
    def ambiguous(self) -> list[list[str]]:
        """Classes of more than one effect."""
        return [group["effects"] for group in self.document["classes"] if len(group["effects"]) > 1]


@dataclass(frozen=True)
class FollowUp:
    """A measurement that is proposed, or was begun already.

    rows : of the proposal, as in the document; why : a sentence per class
    """

    job: Job
    rows: tuple[dict[str, Any], ...]
    why: tuple[str, ...]
    minutes: float
    begun: bool = False


@dataclass(frozen=True)
class Ending:
    """Why nothing more is measured."""

    end: End
    text: str


@dataclass
class Inquiry:
    """An inquiry that stands at some point of its way.

    effects : the model that is judged; the recipe's where empty
    budget : station minutes for follow-ups
    unseen : whether effects that the plan could not see are measured for, too, once nothing is ambiguous
    """

    archive: Archive
    jobs: list[Job]
    lineage: RunSequence
    effects: tuple[str, ...]
    budget: float
    unseen: bool = False
    rounds: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])

    @property
    def base(self) -> Job:
        """The job of the first run."""
        return self.jobs[0]

    @property
    def spent(self) -> float:
        """Station minutes of the follow-ups so far."""
        return sum(self.lineage.minutes()[1:])

    def look(self) -> JointDiagnosis:
        """The diagnosis of everything that was measured so far, with what the station could measure next."""
        dwells, history = self.lineage.dwells(), self.lineage.history()
        around = circumstances(self.base, self.jobs[-1], self.budget - self.spent)
        with threadpool_limits(1):
            found, faults, diagnosis = examined(dwells, history, self.effects)
            following = Proposed() if diagnosis is None else proposed(diagnosis, around)
            told = document(found, faults, diagnosis, following)
        told.update(_named(found, self.effects, diagnosis))
        return JointDiagnosis(self.lineage, self.effects, told, found, diagnosis, following)

    def next(self, finding: JointDiagnosis) -> FollowUp | Ending:
        """What to measure next, or why nothing."""
        begun = self._begun()
        if begun is not None:
            return begun
        ended = _ended(finding)
        showing = finding.following.showing
        if ended is not None:
            if self.unseen and showing is not None and ended.end != "blocked" and len(self.lineage.runs) <= MOST_ROUNDS:
                return self._move((showing,), (shows(finding.state, self.effects, showing),))
            return ended
        if len(self.lineage.runs) > MOST_ROUNDS:
            return Ending("nothing_parts", f"{MOST_ROUNDS} follow-ups have not told {_classes(finding)} apart")
        return self._proposed(finding)

    def _proposed(self, finding: JointDiagnosis) -> FollowUp | Ending:
        diagnosis = finding.diagnosis
        if diagnosis is None:
            return Ending("blocked", "every unit has a data fault")
        left = self.budget - self.spent
        free = finding.following.found
        if not free:
            wanted = proposed(diagnosis, circumstances(self.base, self.jobs[-1], float("inf"))).found
            if not wanted:
                return Ending("nothing_parts", f"nothing that this station does parts {_classes(finding)}")
            needed = sum(p.minutes for p in wanted)
            text = (
                f"telling {_classes(finding)} apart takes {needed:.0f} min more, {max(left, 0.0):.0f} of {self.budget:.0f} min "
                f"are left; give --budget {self.spent + needed:.0f}"
            )
            return Ending("budget", text)
        return self._move(free, tuple(why(finding.state, self.effects, p) for p in free))

    def _move(self, wanted: Sequence[Proposal], reasons: tuple[str, ...]) -> FollowUp:
        """Proposals as a measurement of the station."""
        steps: list[SequenceStep] = [s for p in wanted for s in p.steps]
        job = follow_up(steps, self.base, self.jobs[-1], self.lineage.ids, "; ".join(reasons))
        recipe = job.recipe.model_copy(update={"effects": list(self.effects)})
        job = Job(recipe, job.limits, job.lot, job.station, parents=job.parents)
        rows = tuple(row for p in wanted for row in rows_of(p))
        return FollowUp(job, rows, reasons, sum(p.minutes for p in wanted))

    def _begun(self) -> FollowUp | None:
        """A follow-up of this lineage that was begun before: it was approved then, and goes on."""
        for info in reversed(self.archive.runs()):
            run = self.archive.run(info.id)
            about = run.about
            mine = about.get("parents") == list(self.lineage.ids)
            if mine and about["recipe"]["effects"] == list(self.effects):
                told = files.read_json(run.path / FILE)["round"] if (run.path / FILE).is_file() else {}
                rows, reasons = told.get("next_measurements", ()), told.get("why", [about["recipe"]["description"]])
                return FollowUp(
                    self._again(about), tuple(rows), tuple(reasons), told.get("planned_minutes", 0.0), begun=True
                )
        return None

    def _again(self, about: dict[str, Any]) -> Job:
        """The job of a follow-up that was begun: the station and lot are the first run's, as they are here."""
        recipe = Recipe.model_validate(about["recipe"])
        base = self.base
        return Job(recipe, base.limits, base.lot, base.station, about["capture"], tuple(about["parents"]))

    def runner(self, move: FollowUp, progress: Progress) -> Runner:
        """The runner of a follow-up: its station goes on from where the newest run left it."""
        before = self.archive.capture(self.jobs[-1].capture_id)
        return Runner(move.job, self.archive, progress, measure=_going_on(before))

    def measured(self, move: FollowUp, run: Run) -> None:
        """Takes a follow-up that was measured into the lineage."""
        self.jobs.append(move.job)
        self.lineage = self.lineage.with_run(run)
        minutes = self.lineage.minutes()[-1]
        self.rounds.append(
            {
                "run": run.id,
                "why": list(move.why),
                "next_measurements": list(move.rows),
                "planned_minutes": round(move.minutes, 2),
                "minutes": round(minutes, 2),
                "begun_before": move.begun,
            }
        )

    def keep(self, finding: JointDiagnosis) -> None:
        """Keeps what the newest follow-up has told, with the report of the diagnosis of all runs together."""
        run = self.lineage.runs[-1]
        if len(self.lineage.runs) < 2:
            return
        inputs = {"dwells": run.manifest("dwells")["sha256"]}
        for parent in self.lineage.runs[:-1]:
            inputs[f"dwells of {parent.id}"] = parent.manifest("dwells")["sha256"]
        parameters = {"effects": list(self.effects), "parents": list(self.lineage.ids[:-1])}
        code = code_hash(TABLE_OF_CODE)
        key = stage_key("inquiry", inputs, parameters, code)
        if run.has_report(key):
            return
        from pipelines.report.diagnosis import render_diagnosis

        content = {
            "runs": list(self.lineage.ids),
            "effects": list(self.effects),
            "diagnosis": plain_rows(finding.document),
        }
        files.publish(run.path / FILE, files.json_bytes({**content, "round": self.rounds[-1]}))
        html = render_diagnosis(finding.document, finding.found, finding.diagnosis, " + ".join(self.lineage.ids))
        run.save_report(key, html, {"inputs": inputs, "parameters": parameters, "code": code})

    def document(self, finding: JointDiagnosis, verdict: Ending) -> dict[str, Any]:
        """The whole inquiry as one document."""
        minutes = self.lineage.minutes()
        return {
            "run": self.lineage.ids[0],
            "runs": list(self.lineage.ids),
            "ended": verdict.end,
            "text": verdict.text,
            "minutes": {
                "first_run": round(minutes[0], 2),
                "follow_ups": round(sum(minutes[1:]), 2),
                "budget": round(self.budget, 2),
                "share": round(sum(minutes[1:]) / minutes[0], 4),
            },
            "rounds": self.rounds,
            **finding.document,
        }


def begin(
    archive: Archive, job: Job, run: Run, effects: Sequence[str], budget: float | None, *, unseen: bool = False
) -> Inquiry:
    """The inquiry of a run that was measured: with the budget given, or a share of the station time that it took."""
    lineage = RunSequence((run,))
    allowed = EXTRA * lineage.minutes()[0] if budget is None else budget
    return Inquiry(archive, [job], lineage, tuple(effects or job.recipe.effects), allowed, unseen)


def _going_on(before: Records) -> Any:
    """A measurement that begins with the station as another capture left it."""

    def measure(job: Job, records: Records, progress: Progress) -> None:
        from pipelines.capture.capture import capture
        from stations import open_station

        state = records.last_state() or before.last_state()
        run = f"{job.recipe.name} {job.capture_id}"
        with open_station(job.station, job.lot, resume=state, run=run) as station:
            capture(station, job.recipe, job.lot, records, progress=progress, events=records.events)

    return measure


def _ended(finding: JointDiagnosis) -> Ending | None:
    told = finding.document
    if finding.diagnosis is None:
        return Ending("blocked", "every unit has a data fault; no physics is diagnosed until it is mended")
    if told["adequate"]:
        return Ending("adequate", "the model leaves nothing but the noise that is there")
    if finding.ambiguous:
        return None
    if not told["classes"]:
        return Ending("unexplained", "the model is not adequate, and no effect of the catalogue explains the rest")
    return Ending("told_apart", f"one effect a class stands: {', '.join(told['recommended'])}")


def _classes(finding: JointDiagnosis) -> str:
    return ", and ".join(" | ".join(group) for group in finding.ambiguous)


def _named(found: Measured, effects: Sequence[str], diagnosis: Diagnosis | None) -> dict[str, Any]:
    """What reports and people need beside the fixed keys."""
    from inertial import effects as catalogue
    from inertial.planning.reasons import reason

    unseen = diagnosis.unseen if diagnosis is not None else ()
    breakers = {name: catalogue.get(name).breaker for name in unseen}
    reasons = {} if diagnosis is None else {n: reason(diagnosis.problem.lot.state, n, effects) for n in unseen}
    return {
        "effects": list(effects),
        "units": list(found.units),
        "breakers": breakers,
        "reasons": reasons,
        "offer": None,
    }


def plain_rows(told: dict[str, Any]) -> dict[str, Any]:
    """A document without what only pictures need."""
    return {key: value for key, value in told.items() if key not in {"breakers", "offer"}}
