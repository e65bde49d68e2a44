"""The inquiry as a loop: run, diagnose, propose, measure the follow-up, diagnose again.

The stages run as plain calls or as tasks of the orchestrator; approval of extra station time is supplied by the caller.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from pipelines.archive import Archive
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Done, Runner
from pipelines.inquiry.documents import InquiryDocument
from pipelines.inquiry.inquiry import FOLLOW_UP, Ending, FollowUp, Inquiry, begin
from pipelines.inquiry.lineage import JointDiagnosis
from pipelines.jobs.job import Job
from schemas.progress import Progress, silent

Consent = Literal["go", "stop", "nobody"]


Approval = Callable[[Inquiry, JointDiagnosis, FollowUp], Consent]
"""Approval of extra station time: ``go`` measures the follow-up, ``stop`` declines it, ``nobody``: no person can approve it."""


def always(inquiry: Inquiry, joint: JointDiagnosis, follow_up: FollowUp) -> Consent:
    """Approval of every follow-up within the budget."""
    return "go"


def directly(name: str, runner: Runner) -> Done:
    """A stage as a plain call."""
    return runner.stage(name)


@dataclass(frozen=True)
class InquirySettings:
    """Settings of an inquiry.

    effects : ids of the model to diagnose; the recipe's where empty
    budget : min, station time for follow-ups; a share of the first run where None
    unseen : whether to measure follow-ups for effects that are not visible under the plan, too
    """

    effects: Sequence[str] = ()
    budget: float | None = None
    unseen: bool = False


@dataclass(frozen=True)
class Participants:
    """Who runs the stages of an inquiry, approves extra station time, and is told of stages and joint diagnoses."""

    stage: Callable[[str, Runner], Done] = directly
    approve: Approval = always
    progress: Progress = silent
    stage_done: Callable[[Done], None] = lambda _done: None
    diagnosed: Callable[[JointDiagnosis], None] = lambda _joint: None


def run_inquiry(job: Job, archive: Archive, settings: InquirySettings, participants: Participants) -> InquiryDocument:
    """The document of an inquiry, run until it ends.

    An inquiry that was interrupted continues: completed stages are not repeated, and a follow-up that was started is completed
    first.
    """
    runner = Runner(job, archive, participants.progress)
    for name in ORDER:
        participants.stage_done(participants.stage(name, runner))
    inquiry = begin(archive, job, runner.run, settings.effects, settings.budget, unseen=settings.unseen)
    while True:
        joint = inquiry.diagnose()
        inquiry.save(joint)
        participants.diagnosed(joint)
        follow_up = inquiry.next_step(joint)
        if isinstance(follow_up, Ending):
            return inquiry.document(joint, follow_up)
        consent = "go" if follow_up.begun else participants.approve(inquiry, joint, follow_up)
        if consent != "go":
            return inquiry.document(joint, _not_approved(consent, follow_up))
        runner = inquiry.runner(follow_up, participants.progress)
        for name in FOLLOW_UP:
            participants.stage_done(participants.stage(name, runner))
        inquiry.add_run(follow_up, runner.run)


def _not_approved(consent: Consent, follow_up: FollowUp) -> Ending:
    """The ending of an inquiry whose follow-up was declined, or waits for approval."""
    why = "; ".join(follow_up.why)
    if consent == "stop":
        return Ending("declined", f"a follow-up of {follow_up.minutes:.1f} min was declined: {why}")
    return Ending("asked", f"a follow-up of {follow_up.minutes:.1f} min station time waits for approval: {why}")
