"""The inquiry of one lot: joint diagnosis of all runs so far, and the next follow-up or the reason for the end."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

from threadpoolctl import threadpool_limits

from inertial.next_measurement.proposals import Proposal
from inertial.planning.sequences import SequenceStep
from pipelines.archive import Archive, Run, code_hash, files, stage_key
from pipelines.chain.runner import Runner, from_station
from pipelines.diagnosis.diagnose import Examination, document, examined
from pipelines.diagnosis.documents import DiagnosisDocument, NextMeasurement
from pipelines.diagnosis.next_measurement import Proposed, proposed, rows_of
from pipelines.inquiry.documents import InquiryDocument, InquiryRound
from pipelines.inquiry.explanation import shows, why
from pipelines.inquiry.followup import circumstances, follow_up
from pipelines.inquiry.lineage import JointDiagnosis, RunSequence
from pipelines.jobs.job import Job
from schemas.progress import Progress
from schemas.recipe import Recipe

End = Literal[
    "adequate", "told_apart", "nothing_parts", "budget", "declined", "asked", "blocked", "not_judged", "unexplained"
]


NO_FOLLOW_UP: frozenset[End] = frozenset({"blocked", "not_judged"})
"""Endings after which nothing is measured for effects that are not visible: the data do not judge the model at all."""


@dataclass(frozen=True)
class Ending:
    """Reason for the end of an inquiry."""

    end: End
    text: str


def ending_of(joint: JointDiagnosis) -> Ending | None:
    """The ending that a joint diagnosis leads to; None if the inquiry continues."""
    document = joint.document
    if joint.diagnosis is None:
        return Ending("blocked", "every unit has a data fault; correct it, then diagnose again")
    if document["adequate"]:
        return Ending("adequate", "the model is adequate: the residuals are at the noise floor")
    if document["adequate"] is None:
        return Ending("not_judged", f"the model cannot be judged: {document['reason']}")
    if joint.ambiguous:
        return None
    if not document["classes"]:
        return Ending("unexplained", "the model is not adequate, and no effect of the catalogue explains the residuals")
    return Ending("told_apart", _all_identified(document))


def _all_identified(document: DiagnosisDocument) -> str:
    """Every class has one effect; effects that no left-out dwell can judge are reported."""
    groups = document["classes"]
    text = f"every class contains one effect: {', '.join(g['effects'][0] for g in groups)}"
    unjudged = [g["effects"][0] for g in groups if g.get("scope") != "data" and g.get("heldout_after_ug", 0.0) is None]
    if not unjudged:
        return text
    return f"{text}; no dwells left out can judge {', '.join(unjudged)}: confirm with a fresh run"


def no_follow_up(joint: JointDiagnosis) -> str:
    """Reason for no follow-up: no measurement of the station separates a class, or none is certain enough."""
    if any(joint.following.twins):
        return f"no measurement on this station discriminates between {ambiguous_classes(joint)}"
    return (
        f"no follow-up was found that is expected to discriminate between {ambiguous_classes(joint)}: they differ too little "
        "beside the noise; measure the plan again with longer dwells, or more units"
    )


def ambiguous_classes(joint: JointDiagnosis) -> str:
    """The classes of more than one effect as text."""
    return ", and ".join(" | ".join(group) for group in joint.ambiguous)


EXTRA = 0.3  # default budget of follow-ups, as a share of the first run's station time
MOST_ROUNDS = 6


FOLLOW_UP = ("capture", "validate", "reduce")
FILE = "inquiry.json"


@dataclass(frozen=True)
class FollowUp:
    """A proposed measurement.

    rows : rows of the proposal, as in the document
    why : one sentence per class
    minutes : station time, min
    begun : whether its capture was started before
    """

    job: Job
    rows: tuple[NextMeasurement, ...]
    why: tuple[str, ...]
    minutes: float
    begun: bool = False


@dataclass
class Inquiry:
    """An inquiry between two steps.

    budget : min, station time for follow-ups
    unseen : whether to measure follow-ups for effects that are not visible, too, once no class is ambiguous
    """

    archive: Archive
    jobs: list[Job]
    lineage: RunSequence
    effects: tuple[str, ...]
    budget: float
    unseen: bool = False
    rounds: list[InquiryRound] = field(default_factory=list[InquiryRound])

    @property
    def base(self) -> Job:
        """The job of the first run."""
        return self.jobs[0]

    @property
    def spent(self) -> float:
        """Station time of the follow-ups so far, min."""
        return sum(self.lineage.minutes()[1:])

    def diagnose(self) -> JointDiagnosis:
        """The diagnosis of all runs so far, with proposals for the next measurement."""
        dwells, history = self.lineage.dwells(), self.lineage.history()
        around = circumstances(self.base, self.jobs[-1], self.budget - self.spent)
        with threadpool_limits(1):
            measured, faults, diagnosis = examined(dwells, history, self.effects)
            following = Proposed() if diagnosis is None else proposed(diagnosis, around)
            content = document(measured, faults, diagnosis, self.effects, following)
        content["offer"] = None
        return JointDiagnosis(self.lineage, content, measured, diagnosis, following)

    def next_step(self, joint: JointDiagnosis) -> FollowUp | Ending:
        """The next follow-up, or why the inquiry ends."""
        begun = self._begun()
        if begun is not None:
            return begun
        ended = ending_of(joint)
        showing = joint.following.showing
        last_round = len(self.lineage.runs) > MOST_ROUNDS
        if ended is not None:
            if self.unseen and showing is not None and ended.end not in NO_FOLLOW_UP and not last_round:
                return self._follow_up((showing,), (shows(joint.state, self.effects, showing),))
            return ended
        if last_round:
            return Ending(
                "nothing_parts", f"{MOST_ROUNDS} follow-ups have not discriminated between {ambiguous_classes(joint)}"
            )
        return self._proposed(joint)

    def _proposed(self, joint: JointDiagnosis) -> FollowUp | Ending:
        diagnosis = joint.diagnosis
        if diagnosis is None:
            return Ending("blocked", "every unit has a data fault")
        left = self.budget - self.spent
        affordable = joint.following.separating
        if not affordable:
            proposals = proposed(diagnosis, circumstances(self.base, self.jobs[-1], float("inf"))).separating
            if not proposals:
                return Ending("nothing_parts", no_follow_up(joint))
            needed = sum(p.minutes for p in proposals)
            text = (
                f"discriminating between {ambiguous_classes(joint)} needs {needed:.0f} min more station time, "
                f"{max(left, 0.0):.0f} of {self.budget:.0f} min are left; give --budget {self.spent + needed:.0f}"
            )
            return Ending("budget", text)
        return self._follow_up(affordable, tuple(why(joint.state, self.effects, p) for p in affordable))

    def _follow_up(self, proposals: Sequence[Proposal], reasons: tuple[str, ...]) -> FollowUp:
        steps: list[SequenceStep] = [s for p in proposals for s in p.steps]
        job = follow_up(steps, self.base, self.jobs[-1], self.lineage.ids, "; ".join(reasons))
        job = replace(job, recipe=job.recipe.model_copy(update={"effects": list(self.effects)}))
        rows = tuple(row for p in proposals for row in rows_of(p))
        return FollowUp(job, rows, reasons, sum(p.minutes for p in proposals))

    def _begun(self) -> FollowUp | None:
        """The follow-up of this lineage whose capture was started before; it was approved then. None where there is none."""
        for info in reversed(self.archive.runs()):
            run = self.archive.run(info.id)
            about = run.about
            same_lineage = about.get("parents") == list(self.lineage.ids)
            if same_lineage and about["recipe"]["effects"] == list(self.effects):
                saved = files.read_json(run.path / FILE)["round"] if (run.path / FILE).is_file() else {}
                rows, reasons = saved.get("next_measurements", ()), saved.get("why", [about["recipe"]["description"]])
                recipe = Recipe.model_validate(about["recipe"])
                job = replace(self.base, recipe=recipe, captured=about["capture"], parents=tuple(about["parents"]))
                return FollowUp(job, tuple(rows), tuple(reasons), saved.get("planned_minutes", 0.0), begun=True)
        return None

    def runner(self, follow_up: FollowUp, progress: Progress) -> Runner:
        """The runner of a follow-up: the station continues from the state at the end of the newest run."""
        before = self.archive.capture(self.jobs[-1].capture_id)
        return Runner(follow_up.job, self.archive, progress, measure=partial(from_station, before=before))

    def add_run(self, follow_up: FollowUp, run: Run) -> None:
        """Adds the run of a measured follow-up to the lineage."""
        self.jobs.append(follow_up.job)
        self.lineage = RunSequence((*self.lineage.runs, run))
        minutes = self.lineage.minutes()[-1]
        self.rounds.append(
            {
                "run": run.id,
                "why": list(follow_up.why),
                "next_measurements": list(follow_up.rows),
                "planned_minutes": round(follow_up.minutes, 2),
                "minutes": round(minutes, 2),
                "begun_before": follow_up.begun,
            }
        )

    def save(self, joint: JointDiagnosis) -> None:
        """Saves the joint diagnosis and its report with the newest follow-up."""
        run = self.lineage.runs[-1]
        if len(self.lineage.runs) < 2:
            return
        inputs = {"dwells": run.manifest("dwells")["sha256"]}
        for parent in self.lineage.runs[:-1]:
            inputs[f"dwells of {parent.id}"] = parent.manifest("dwells")["sha256"]
        parameters = {"effects": list(self.effects), "parents": list(self.lineage.ids[:-1])}
        code = code_hash("inquiry")
        key = stage_key("inquiry", inputs, parameters, code)
        if run.has_report(key):
            return
        from pipelines.report.diagnosis import render_diagnosis

        diagnosis = {key: value for key, value in joint.document.items() if key not in {"breakers", "offer"}}
        content = {"runs": list(self.lineage.ids), "effects": list(self.effects), "diagnosis": diagnosis}
        files.publish(run.path / FILE, files.json_bytes({**content, "round": self.rounds[-1]}))
        made = Examination(joint.document, joint.measured, joint.diagnosis)
        html = render_diagnosis(made, " + ".join(self.lineage.ids))
        run.save_report(key, html, {"inputs": inputs, "parameters": parameters, "code": code})

    def document(self, joint: JointDiagnosis, ending: Ending) -> InquiryDocument:
        """The whole inquiry as one document."""
        minutes = self.lineage.minutes()
        return {
            "run": self.lineage.ids[0],
            "runs": list(self.lineage.ids),
            "ended": ending.end,
            "text": ending.text,
            "minutes": {
                "first_run": round(minutes[0], 2),
                "follow_ups": round(sum(minutes[1:]), 2),
                "budget": round(self.budget, 2),
                "share": round(sum(minutes[1:]) / minutes[0], 4),
            },
            "rounds": self.rounds,
            **joint.document,
        }


def begin(
    archive: Archive, job: Job, run: Run, effects: Sequence[str], budget: float | None, *, unseen: bool = False
) -> Inquiry:
    """The inquiry of a finished run, with a budget in min, or a share of the run's station time where None."""
    lineage = RunSequence((run,))
    allowed = EXTRA * lineage.minutes()[0] if budget is None else budget
    return Inquiry(archive, [job], lineage, tuple(effects or job.recipe.effects), allowed, unseen)
