"""``tumbleline operator``: answers runs that wait for somebody, at any terminal that reaches their orchestrator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.options import ArchiveOption, JsonOption, console, print_json, print_table

if TYPE_CHECKING:
    from pipelines.chain.attendance import Answer
    from pipelines.flows.operator import Waiting

PART = "Measure"
ORDER = 140
SUMMARY = "Answer the questions of runs that wait for an operator."
EXAMPLES = (
    "tumbleline operator",
    "tumbleline operator line-six --go",
)


def command(
    run: Annotated[
        str, typer.Argument(metavar="[FLOW-RUN]", help="Which one is answered, by the beginning of its name or id.")
    ] = "",
    archive: ArchiveOption = None,
    *,
    go: Annotated[bool, typer.Option("--go", help="It is done: the run goes on.")] = False,
    stop: Annotated[
        bool, typer.Option("--stop", help="Leave it: the run stops, and goes on when it is started again.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Show which runs wait for the operator and what they ask, and answer them with --go or --stop."""
    from schemas.errors import WrongUse

    if go and stop:
        raise WrongUse("operator: --go and --stop, one answer is needed; leave one out")
    _reach(archive)
    from pipelines.flows.operator import answer, waiting

    found = [one for one in waiting() if one.name.startswith(run) or one.id.startswith(run)]
    if go or stop:
        chosen, reply = _one(found, run), _answer(go=go)
        answer(chosen.id, reply)
        found = [chosen]
    if as_json:
        print_json({"waiting": [vars(one) for one in found], "answered": "go" if go else "stop" if stop else None})
    elif go or stop:
        console().print(f"{found[0].name}: {'goes on' if go else 'stops'}", markup=False)
    elif found:
        print_table(["run", "asks"], [[one.name, one.question] for one in found])
    else:
        console().print("no run waits for anybody", markup=False)


def _answer(*, go: bool) -> Answer:
    return "go" if go else "stop"


def _reach(archive: str | None) -> None:
    """Points the client at the server in the environment, or at the one beside the archive."""
    import os

    from pipelines.archive import Archive
    from pipelines.flows.local import environment_of, reach_named
    from schemas.errors import WrongUse

    if os.environ.get("PREFECT_API_URL"):
        reach_named()
        return
    found = environment_of(Archive(archive))
    if not found:
        raise WrongUse(
            "operator: no orchestrator answers beside this archive, so that nothing waits there; name its --archive"
        )
    os.environ.update(found)


def _one(found: list[Waiting], run: str) -> Waiting:
    from schemas.errors import WrongUse

    if len(found) != 1:
        names = ", ".join(one.name for one in found) or "none"
        raise WrongUse(
            f"operator: {len(found)} waiting runs begin with '{run}' ({names}), one is needed; write more of its name"
        )
    return found[0]
