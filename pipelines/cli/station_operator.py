"""``tumbleline station operator``: answers the questions of waiting runs, at any terminal that reaches their orchestrator."""

import os
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import give, print_table, say
from schemas.errors import WrongUse
from schemas.foreign import shown

if TYPE_CHECKING:
    from pipelines.chain.attendance import Answer


def operator(
    run: Annotated[str, argument("[FLOW-RUN]", "The run to answer: the beginning of its name or id.")] = "",
    answered: Annotated[
        str, option("--answer go|stop", "go: the run continues; stop: the same 'tumbleline run' continues it later.")
    ] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show the runs that wait for the operator and their questions; answer with --answer."""
    if answered not in {"", "go", "stop"}:
        raise WrongUse(f"operator: --answer {shown(answered)}, go or stop is needed; correct it")
    _reach(archive)
    from pipelines.flows.operator import answer, waiting

    matches = [flow_run for flow_run in waiting() if flow_run.name.startswith(run) or flow_run.id.startswith(run)]
    reply: Answer | None = "go" if answered == "go" else "stop" if answered else None
    if reply is not None:
        if len(matches) != 1:
            names = ", ".join(flow_run.name for flow_run in matches) or "none"
            raise WrongUse(
                f"operator: {len(matches)} waiting runs begin with '{run}' ({names}), one is needed; give more of its name"
            )
        answer(matches[0].id, reply)
    give({"waiting": [vars(flow_run) for flow_run in matches], "answered": reply}, _print, as_json=as_json)


def _print(document: dict[str, Any]) -> None:
    reply, waiting = document["answered"], document["waiting"]
    if reply is not None:
        say(f"{waiting[0]['name']}: {'continues' if reply == 'go' else 'stops'}")
    elif waiting:
        print_table(["run", "asks"], [[flow_run["name"], flow_run["question"]] for flow_run in waiting])
    else:
        say("no run waits for the operator")


def _reach(archive: str | None) -> None:
    """Connect the client to the server of the environment, or to the server of the archive."""
    from pipelines.flows.local import environment_of, reach_named

    if os.environ.get("PREFECT_API_URL"):
        reach_named()
        return
    matches = environment_of(Archive(archive))
    if not matches:
        raise WrongUse(
            "operator: no orchestrator of this archive answers, so that no run waits; give the archive of the run with --archive"
        )
    os.environ.update(matches)
