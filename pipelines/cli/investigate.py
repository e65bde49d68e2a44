"""``tumbleline investigate``: run, diagnose, propose, measure only that, diagnose again, until one effect a class stands."""

from __future__ import annotations

import shlex
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.options import (
    ArchiveOption,
    JsonOption,
    RecipeArgument,
    RepeatOption,
    SeedOption,
    StationOption,
    console,
    error_console,
    print_json,
    print_table,
    short,
)
from pipelines.cli.run import shown
from schemas.errors import DONE, PART_FAILED

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from pipelines.inquiry.inquiry import FollowUp, Inquiry, JointDiagnosis
    from pipelines.inquiry.loop import Approval, Consent, Participants, Settings
    from pipelines.jobs.job import Request

PART = "Measure"
ORDER = 130
SUMMARY = "Measure a lot, then measure only what separates the effects that may be missing."

SETTLED = frozenset({"adequate", "told_apart"})


def command(
    recipe: RecipeArgument = "production",
    station: StationOption = None,
    units: Annotated[
        str, typer.Option("--units", metavar="SN,…|FILE", help="Serial numbers slot by slot, or a slot map.")
    ] = "",
    archive: ArchiveOption = None,
    seed: SeedOption = None,
    repeat: RepeatOption = 0,
    effects: Annotated[
        str, typer.Option("--effects", metavar="a,b,c", help="The model to judge; the recipe's by default.")
    ] = "",
    budget: Annotated[
        float | None,
        typer.Option(
            "--budget",
            min=0.0,
            metavar="MIN",
            help="Station minutes for follow-ups; 30 % of the first run's by default.",
        ),
    ] = None,
    *,
    yes: Annotated[
        bool | None,
        typer.Option(
            "--yes/--ask",
            help="Spend the budget without asking; or ask, at the terminal or through a paused flow run.",
        ),
    ] = None,
    unseen: Annotated[
        bool, typer.Option("--unseen", help="Measure for effects, too, that the plan could not see.")
    ] = False,
    direct: Annotated[bool, typer.Option("--direct", help="Work without the orchestrator.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Measure a lot, diagnose it, and let the station measure only what tells apart the effects that may be missing.

    It ends when one effect a class stands, when the model leaves nothing but noise, or when the budget is spent. The same
    command, given again after it was stopped, goes on where it was. Exit status 0: that is so; 1: rivals are left.
    """
    from pipelines.archive import Archive
    from pipelines.cli.terminal import attended
    from pipelines.inquiry.loop import Settings
    from pipelines.jobs.job import Request
    from pipelines.jobs.model_files import chosen_effects
    from pipelines.jobs.seating import read_seating

    seating = read_seating(units)
    request = Request(recipe, station, seating.units, seating.slots, seed, repeat)
    terms = Settings(tuple(chosen_effects(effects, None, "investigate") or ()), budget, unseen)
    here = attended() and not as_json
    paused = yes is False and not here and not direct
    document = _inquired(request, Archive(archive), terms, _consent(yes=yes, here=here), direct=direct, paused=paused)
    document["command"] = _again(document) if document["ended"] in {"asked", "declined"} else None
    if as_json:
        print_json(document)
    else:
        print_inquiry(document)
    raise typer.Exit(DONE if document["ended"] in SETTLED else PART_FAILED)


def _consent(*, yes: bool | None, here: bool) -> Callable[[Callable[[], AbstractContextManager[None]]], Approval]:
    """Who approves the extra minutes: nobody has to, whoever sits at the terminal, or nobody is there."""
    from pipelines.inquiry.loop import always

    def asked(quiet: Callable[[], AbstractContextManager[None]]) -> Approval:
        def ask(inquiry: Inquiry, finding: JointDiagnosis, move: FollowUp) -> Consent:
            with quiet():
                return _question(inquiry, finding, move)

        return ask

    def nobody(inquiry: Inquiry, finding: JointDiagnosis, move: FollowUp) -> Consent:
        del inquiry, finding, move
        return "nobody"

    if yes:
        return lambda _quiet: always
    return asked if here else lambda _quiet: nobody


def _question(inquiry: Inquiry, finding: JointDiagnosis, move: FollowUp) -> Consent:
    """What the person at the terminal says to a proposal."""
    from pipelines.cli.diagnosis_text import measurements_table
    from pipelines.cli.terminal import agreed

    out = error_console()
    for sentence in move.why:
        out.print(f"\n{sentence}.", markup=False, soft_wrap=True)
    measurements_table(list(move.rows), out)
    del finding
    left = inquiry.budget - inquiry.spent
    text = f"Measure for {move.minutes:.1f} min more ({left:.1f} of {inquiry.budget:.1f} min are left)?"
    return "go" if agreed(text) else "stop"


def _inquired(
    request: Request,
    archive: Any,
    terms: Settings,
    consent: Callable[[Callable[[], AbstractContextManager[None]]], Approval],
    *,
    direct: bool,
    paused: bool,
) -> dict[str, Any]:
    """The document of the inquiry."""
    from pipelines.inquiry.loop import Participants, directly, play

    with shown() as (progress, told, quiet):

        def looked(finding: JointDiagnosis) -> None:
            with quiet():
                _tell(finding)

        table: Participants = Participants(directly, consent(quiet), progress, told, looked)
        if direct:
            return play(request.job(archive), archive, terms, table)
        from pipelines.flows.investigate import investigate_locally

        return investigate_locally(request, archive, terms, table, ask=paused)


def _tell(finding: JointDiagnosis) -> None:
    """A line for each diagnosis on the way."""
    from pipelines.cli.diagnosis_text import verdict

    error_console().print(
        f"diagnosis of {len(finding.lineage.runs)}: {verdict(finding.document)}", markup=False, soft_wrap=True
    )


def _again(document: dict[str, Any]) -> str:
    """The command that goes on with what was proposed."""
    del document
    given = [a for a in sys.argv[1:] if a not in {"--ask", "--json"}]
    return shlex.join(["tumbleline", *given, "--yes"])


def print_inquiry(document: dict[str, Any]) -> None:
    """Print an inquiry."""
    from pipelines.cli.diagnosis_text import measurements_table, print_findings, verdict

    out = console()
    good = document["ended"] in {"adequate", "told_apart"}
    out.print(verdict(document), style="bold green" if document["adequate"] else "bold red", soft_wrap=True)
    _rounds(document)
    print_findings(document)
    out.print(
        f"{document['text'][:1].upper()}{document['text'][1:]}.", style="green" if good else "yellow", soft_wrap=True
    )
    if document["ended"] in {"asked", "declined"}:
        measurements_table(document["next_measurements"])
        out.print("\nNext:", style="bold")
        out.print(f"  {document['command']}", markup=False, soft_wrap=True)
    elif document["recommended"]:
        out.print("\nNext:", style="bold")
        for name in document["recommended"]:
            out.print(f"  tumbleline extend model.toml {name}", markup=False, soft_wrap=True)


def _rounds(document: dict[str, Any]) -> None:
    minutes = document["minutes"]
    first, further = short(minutes["first_run"]), short(minutes["follow_ups"]) or "0"
    text = (
        f"Station time: {first} min for the first run ({document['run']}), {further} min for follow-ups "
        f"({100.0 * minutes['share']:.0f} %), {short(minutes['budget'])} min were allowed."
    )
    console().print(text, markup=False, soft_wrap=True)
    if document["rounds"]:
        lines = [[r["run"], short(r["minutes"]), "\n".join(r["why"])] for r in document["rounds"]]
        print_table(["follow-up", "min", "why"], lines, title="What the station measured besides")
