"""The flow ``investigate``: run, diagnose, propose, measure only that, diagnose again; a task per stage of every run.

Where a person must approve extra station time the flow run pauses with the question and waits for the answer, as for the
operator: from the server's page, from ``tumbleline station operator``, or from any client of the server.
"""

from dataclasses import dataclass, replace
from typing import Any

from prefect import flow

from pipelines.archive import Archive
from pipelines.chain.attendance import Prompt
from pipelines.chain.runner import Done, Runner
from pipelines.flows.calibrate import requested, stage, with_last
from pipelines.flows.local import flow_run
from pipelines.flows.operator import Paused
from pipelines.inquiry.documents import InquiryDocument
from pipelines.inquiry.inquiry import FollowUp, Inquiry
from pipelines.inquiry.lineage import JointDiagnosis
from pipelines.inquiry.loop import Consent, InquirySettings, Participants, run_inquiry
from pipelines.jobs.job import Request
from pipelines.orchestrator.archive_address import archive_of

_participants: list[Participants] = []  # whom inquiries of this process report to and ask: the last of them counts


@dataclass(frozen=True)
class PausedApproval:
    """Approval by the person who answers the paused flow run."""

    paused: Paused

    def __call__(self, inquiry: Inquiry, joint: JointDiagnosis, follow_up: FollowUp) -> Consent:
        """Wait for the answer, without a limit of time."""
        why = "; ".join(follow_up.why)
        text = f"measure {follow_up.minutes:.1f} min more ({inquiry.budget - inquiry.spent:.1f} min are left): {why}"
        return self.paused.ask(Prompt("approve", inquiry.lineage.ids[0], text))


@flow(name="investigate", persist_result=False, log_prints=False)
def investigate(  # noqa: PLR0913 - the parameters of a flow are the form on the server's page
    recipe: str = "production",
    station: str | None = None,
    units: list[str] | None = None,
    slots: list[int] | None = None,
    archive: str | None = None,
    seed: int | None = None,
    repeat: int | None = None,
    faults: list[str] | None = None,
    *,
    effects: list[str] | None = None,
    budget_min: float | None = None,
    unseen: bool = False,
    ask: bool = False,
) -> InquiryDocument:
    """Measure a lot, then only what separates the possible missing effects; return the document of the inquiry.

    Without ``repeat`` every flow run measures the lot again, and a retry of the same flow run continues it. With ``ask``
    the flow run pauses before every follow-up until its station time is approved.
    """
    store = archive_of(archive)
    job = requested(recipe, station, units, slots, seed, repeat, faults).job(store)

    def as_task(name: str, runner: Runner) -> Done:
        return stage.with_options(task_run_name=f"{runner.job.recipe.name} {name}")(name, runner)

    participants = _participants[-1] if _participants else Participants()
    approve = PausedApproval(Paused()) if ask else participants.approve
    at = replace(participants, stage=as_task, approve=approve)
    return run_inquiry(job, store, InquirySettings(tuple(effects or ()), budget_min, unseen), at)


def investigate_locally(
    request: Request, archive: Archive, settings: InquirySettings, participants: Participants, *, ask: bool
) -> InquiryDocument:
    """Run the flow on the server of PREFECT_API_URL or on a temporary one; return the document of the inquiry."""
    archive.prepare()
    job = request.job(archive)
    name = f"investigate {job.recipe.name} {job.capture_id}"
    with flow_run(archive, name) as address, with_last(_participants, participants):
        flow = investigate.with_options(flow_run_name=name)
        document: Any = flow(
            **request.parameters(),
            archive=address,
            effects=list(settings.effects),
            budget_min=settings.budget,
            unseen=settings.unseen,
            ask=ask,
        )
    return document
