"""The operator behind the orchestrator: the flow run pauses with the question and continues with the answer.

The answer comes from the server's page, from ``tumbleline station operator`` at any terminal, or from any client of the server.
"""

import json
from dataclasses import dataclass
from typing import Literal
from uuid import UUID

from httpx import HTTPStatusError
from prefect import pause_flow_run
from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterState, FlowRunFilterStateType
from prefect.client.schemas.objects import FlowRun, StateType
from prefect.input import RunInput

from pipelines.chain.attendance import Answer, Prompt

PATIENCE_S = 7 * 24 * 3600
POLL_S = 1


class Reply(RunInput):
    """The answer of the operator."""

    answer: Literal["go", "stop"] = "go"


@dataclass(frozen=True)
class Waiting:
    """A flow run that waits for an answer."""

    id: str
    name: str
    question: str


class Paused:
    """The operator who answers the paused flow run."""

    def ask(self, prompt: Prompt) -> Answer:
        """Wait for the answer, without a limit of time."""
        seats = "".join(f"\n- slot {slot}: {serial}" for slot, serial in prompt.slots)
        question = f"{prompt.kind}: {prompt.text}.{seats}"
        form: type[Reply] = Reply.with_initial_data(description=question)
        reply = pause_flow_run(form, timeout=PATIENCE_S, poll_interval=POLL_S)
        return reply.answer


def waiting() -> list[Waiting]:
    """Flow runs that wait for an answer, in the order of their start."""
    flow_filter = FlowRunFilter(state=FlowRunFilterState(type=FlowRunFilterStateType(any_=[StateType.PAUSED])))
    with get_client(sync_client=True) as client:
        waiting_runs = [
            Waiting(str(run.id), run.name, _question(client, run))
            for run in client.read_flow_runs(flow_run_filter=flow_filter)
        ]
    return [run for run in waiting_runs if run.question]


def answer(flow_run: str, reply: Answer) -> None:
    """Resume a flow run with an answer."""
    with get_client(sync_client=True) as client:
        client.resume_flow_run(UUID(flow_run), run_input={"answer": reply})


def _question(client: SyncPrefectClient, run: FlowRun) -> str:
    keys = run.state.state_details.run_input_keyset if run.state else None
    if not keys:
        return ""
    try:
        return str(json.loads(client.read_flow_run_input(run.id, keys["description"])))
    except (HTTPStatusError, ValueError):  # paused without a question of this program
        return ""
