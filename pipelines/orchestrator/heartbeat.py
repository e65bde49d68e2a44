"""The server closes runs without a heartbeat as crashed, where no process at the station can do so.

A flow sends a heartbeat every ``HEARTBEAT_S`` (the shortest period that Prefect allows). An automation of the server marks a run
as crashed that has sent none for ``SILENCE_S`` and has no final state: its computer has no power, or its network is down.
"""

from __future__ import annotations

from datetime import timedelta

from prefect.client.orchestration import get_client
from prefect.client.schemas.objects import StateType
from prefect.events.actions import ActionTypes, ChangeFlowRunState
from prefect.events.schemas.automations import AutomationCore, EventTrigger, Posture
from prefect.events.schemas.events import ResourceSpecification

HEARTBEAT_S = 30
SILENCE_S = 60
VARIABLE = "PREFECT_FLOWS_HEARTBEAT_FREQUENCY"
NAME = "tumbleline: runs without a heartbeat"
HEARTBEAT = "prefect.flow-run.heartbeat"
ENDS = ("Completed", "Failed", "Cancelled", "Crashed", "Suspended")
"""Events after which no heartbeat follows; a suspended run waits for the operator without a process."""

MESSAGE = f"no heartbeat for {SILENCE_S} s: its computer or its network is down"


def have_automation() -> None:
    """Make or renew the automation of the server."""
    ends = {f"prefect.flow-run.{end}" for end in ENDS}
    close: list[ActionTypes] = [
        ChangeFlowRunState(state=StateType.CRASHED, name="Crashed", message=MESSAGE, force=False)
    ]
    keep(
        AutomationCore(
            name=NAME,
            description="Made by pipelines.flows.deploy; changes are overwritten there.",
            enabled=True,
            trigger=EventTrigger(
                after={HEARTBEAT},
                expect={HEARTBEAT, *ends},
                match=ResourceSpecification({"prefect.resource.id": ["prefect.flow-run.*"]}),
                for_each={"prefect.resource.id"},
                posture=Posture.Proactive,
                threshold=1,
                within=timedelta(seconds=SILENCE_S),
            ),
            actions=close,
        )
    )


def keep(automation: AutomationCore) -> None:
    """Make an automation, or update the existing one of the same name; further ones of the name are removed."""
    with get_client(sync_client=True) as client:
        same = [existing.id for existing in client.read_automations_by_name(automation.name)]
        if not same:
            client.create_automation(automation)
            return
        client.update_automation(same[0], automation)
        for further in same[1:]:
            client.delete_automation(further)
