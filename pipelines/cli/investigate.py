"""``tumbleline investigate``: run, diagnose, measure follow-ups, until every class of the diagnosis contains one effect."""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING, Annotated

from pipelines.archive import Archive
from pipelines.cli import options
from pipelines.cli.next_commands import Given, command_line, judged_data, print_extension, print_next
from pipelines.cli.options import option
from pipelines.cli.printing import conclude, error_console, print_table, remark, say, short
from pipelines.cli.run import shown
from pipelines.cli.text.verdict_text import print_verdict

if TYPE_CHECKING:
    from pipelines.inquiry.documents import InquiryDocument
    from pipelines.inquiry.inquiry import FollowUp, Inquiry
    from pipelines.inquiry.lineage import JointDiagnosis
    from pipelines.inquiry.loop import Consent

PART = "Measure"
ORDER = 130
SUMMARY = "Measure a lot, then measure only what separates the effects that may be missing."
EXAMPLES = ("tumbleline investigate my.toml --yes", "tumbleline investigate my.toml --station line-1.toml --budget 60")

SETTLED = frozenset({"adequate", "told_apart"})


def command(
    recipe: options.RecipeArgument = "production",
    station: options.StationOption = None,
    units: Annotated[str, option("--units SN,…|FILE", "Serial numbers slot by slot, or a slot map.")] = "",
    archive: options.ArchiveOption = None,
    seed: options.SeedOption = None,
    repeat: options.RepeatOption = 0,
    effects: Annotated[
        str, option("--effects a,b,c", "Effects of the model to diagnose; the recipe's by default.")
    ] = "",
    budget: Annotated[
        float | None,
        option("--budget MIN", "Station time for follow-ups, min; 30 % of the first run by default.", min=0.0),
    ] = None,
    *,
    yes: Annotated[
        bool | None,
        option(
            "--yes/--ask",
            "Use extra station time without a question; default: ask.",
        ),
    ] = None,
    unseen: Annotated[
        bool, option("--unseen", "Also measure follow-ups for effects that are not visible in the first run.")
    ] = False,
    direct: Annotated[bool, option("--direct", "Run without the orchestrator.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Measure a lot, diagnose it, and measure follow-ups that discriminate between the effects that may be missing.

    It ends when each missing effect is separated from all others, when the residuals are at the noise floor, or when the budget
    is spent. An interrupted inquiry continues when the same command is given again. Exit status 0: the model is adequate or the
    effects are identified; 1: neither.
    """
    from pipelines.cli.terminal import attended
    from pipelines.diagnosis.sentences import verdict
    from pipelines.inquiry.loop import InquirySettings, Participants, always, directly, run_inquiry
    from pipelines.jobs.job import Request
    from pipelines.jobs.model_files import chosen_effects
    from pipelines.jobs.seating import read_seating

    seating, store = read_seating(units), Archive(archive)
    request = Request(recipe, station, seating.units, seating.slots, seed, repeat)
    settings = InquirySettings(tuple(chosen_effects(effects, None, "investigate") or ()), budget, unseen)
    at_terminal = attended() and not as_json
    with shown() as (progress, stage_done, quiet):

        def ask(inquiry: Inquiry, joint: JointDiagnosis, follow_up: FollowUp) -> Consent:
            with quiet():
                return _answer(inquiry, follow_up) if at_terminal else "nobody"

        def diagnosed(joint: JointDiagnosis) -> None:
            runs = len(joint.lineage.runs)
            with quiet():
                remark(f"diagnosis of {runs} run{'s' if runs > 1 else ''}: {verdict(joint.document)}")

        participants = Participants(directly, always if yes else ask, progress, stage_done, diagnosed)
        if direct:
            document = run_inquiry(request.job(store), store, settings, participants)
        else:
            from pipelines.flows.investigate import investigate_locally

            paused = yes is False and not at_terminal
            document = investigate_locally(request, store, settings, participants, ask=paused)
    again = [word for word in sys.argv[1:] if word not in {"--ask", "--json"}]
    document["command"] = command_line(*again, "--yes") if document["ended"] in {"asked", "declined"} else None
    show = partial(print_inquiry, archive=archive)
    conclude(document, show, as_json=as_json, passed=document["ended"] in SETTLED)


def _answer(inquiry: Inquiry, follow_up: FollowUp) -> Consent:
    from pipelines.cli.terminal import agreed
    from pipelines.cli.text.diagnosis_text import print_next_measurement

    for sentence in follow_up.why:
        remark(f"\n{sentence}.")
    print_next_measurement(list(follow_up.rows), error_console())
    left = inquiry.budget - inquiry.spent
    text = f"Measure this follow-up ({follow_up.minutes:.1f} min; {left:.1f} of {inquiry.budget:.1f} min budget left)?"
    return "go" if agreed(text) else "stop"


def print_inquiry(document: InquiryDocument, archive: str | None = None) -> None:
    """Print an inquiry; ``archive`` as it was given, for the commands to give next."""
    from pipelines.cli.text.diagnosis_text import print_findings, print_next_measurement

    print_verdict(document)
    _rounds(document)
    print_findings(document)
    say(
        f"{document['text'][:1].upper()}{document['text'][1:]}.",
        style="green" if document["ended"] in SETTLED else "yellow",
    )
    if document["ended"] in {"asked", "declined"}:
        print_next_measurement(document["next_measurements"])
        print_next([command for command in (document.get("command"),) if command])
    else:
        print_extension(document, partial(judged_data, document["run"], "", Given(archive)), None)


def _rounds(document: InquiryDocument) -> None:
    minutes = document["minutes"]
    first, further = short(minutes["first_run"]), short(minutes["follow_ups"]) or "0"
    say(
        f"Station time: {first} min first run ({document['run']}), {further} min follow-ups "
        f"({100.0 * minutes['share']:.0f} %), {short(minutes['budget'])} min budget."
    )
    if document["rounds"]:
        lines = [[r["run"], short(r["minutes"]), "\n".join(r["why"])] for r in document["rounds"]]
        print_table(["run", "station time, min", "reason"], lines, title="Follow-ups")
