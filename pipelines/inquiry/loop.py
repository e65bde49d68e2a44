"""An inquiry from beginning to end: run, diagnose, propose, measure only that, diagnose again.

Who does the stages (a plain call, or a task of the orchestrator) and who approves the extra minutes is another's business.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.inquiry.inquiry import FOLLOW_UP, Ending, FollowUp, Inquiry, JointDiagnosis, begin
from schemas.progress import silent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pipelines.archive import Archive
    from pipelines.chain.runner import Done
    from pipelines.jobs.job import Job
    from schemas.progress import Progress

Consent = Literal["go", "stop", "nobody"]


class Stages(Protocol):
    """Whoever does a stage."""

    def __call__(self, name: str, runner: Runner) -> Done:
        """One stage of a runner."""
        ...


class Approval(Protocol):
    """Whoever approves the extra minutes."""

    def __call__(self, inquiry: Inquiry, finding: JointDiagnosis, move: FollowUp) -> Consent:
        """``go`` to measure it, ``stop`` to leave it, ``nobody`` where there is nobody to be asked."""
        ...


def always(inquiry: Inquiry, finding: JointDiagnosis, move: FollowUp) -> Consent:
    """Everything within the budget is approved."""
    del inquiry, finding, move
    return "go"


def directly(name: str, runner: Runner) -> Done:
    """A stage as a plain call."""
    return runner.stage(name)


@dataclass(frozen=True)
class Settings:
    """What an inquiry is given: the model to judge (the recipe's where empty), and station minutes for follow-ups.

    ``unseen``: effects that the plan could not see are measured for, too.
    """

    effects: Sequence[str] = ()
    budget: float | None = None
    unseen: bool = False


@dataclass(frozen=True)
class Participants:
    """Who takes part: who does the stages, who approves, and who is told."""

    stage: Stages = directly
    approve: Approval = always
    progress: Progress = silent
    told: Callable[[Done], None] = lambda _done: None
    looked: Callable[[JointDiagnosis], None] = lambda _finding: None


def play(job: Job, archive: Archive, terms: Settings, table: Participants) -> dict[str, Any]:
    """The document of an inquiry that went as far as it could.

    Given again after it was stopped it goes on where it was: what was measured is not measured again, and a follow-up that was
    begun is finished first.
    """
    runner = Runner(job, archive, table.progress)
    for name in ORDER:
        table.told(table.stage(name, runner))
    inquiry = begin(archive, job, runner.run, terms.effects, terms.budget, unseen=terms.unseen)
    while True:
        finding = inquiry.look()
        inquiry.keep(finding)
        table.looked(finding)
        move = inquiry.next(finding)
        if isinstance(move, Ending):
            return inquiry.document(finding, move)
        consent = "go" if move.begun else table.approve(inquiry, finding, move)
        if consent != "go":
            return inquiry.document(finding, _left(consent, move))
        follower = inquiry.runner(move, table.progress)
        for name in FOLLOW_UP:
            table.told(table.stage(name, follower))
        inquiry.measured(move, follower.run)


def _left(consent: Consent, move: FollowUp) -> Ending:
    """Why a proposal was not measured."""
    told = "; ".join(move.why)
    if consent == "stop":
        return Ending("declined", f"not approved: {move.minutes:.1f} min for: {told}")
    return Ending("asked", f"{move.minutes:.1f} min of the station's time wait for approval: {told}")
