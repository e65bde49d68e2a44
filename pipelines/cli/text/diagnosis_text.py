"""A diagnosis for people: verdict, picture, classes of missing effects, cost to decide, and the next command last."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from pipelines.cli.next_commands import FindData, print_next_of_diagnosis
from pipelines.cli.printing import console, print_table, say, warn
from pipelines.cli.text.verdict_text import print_verdict
from pipelines.diagnosis import sections, sentences
from pipelines.diagnosis.documents import DiagnosisDocument, NextMeasurement
from pipelines.diagnosis.sections import Section

if TYPE_CHECKING:
    from pipelines.diagnosis.diagnose import Examination


def print_diagnosis(
    document: DiagnosisDocument,
    *,
    made: "Examination | None" = None,
    data: FindData | None,
    model: Path | None,
    brief: bool = True,
) -> None:
    """Print a diagnosis on one screen: verdict, picture, missing effects, what it costs to decide, and the next command last.

    made : draws the picture; None: there is none
    data : gives the data as they were named on the command line, where commands to give next are printed; None: none are printed
    model : the model file as it was given there
    brief : without the long tables; a sentence counts what they list
    """
    print_verdict(document)
    if not brief:
        _dim(sentences.evidence_text(document))
    if sentences.few_dwells(document):
        _dim(sentences.undetected(document))
    _dim(sentences.slow_noise(document))
    print_section(sections.faults(document))
    _picture(made)
    print_findings(document, brief=brief)
    _unexplained(document, model)
    if brief:
        for text in sentences.cost_to_decide(document):
            say(text)
        notes = sentences.not_listed(document)
        _dim(f"{notes + '; ' if notes else ''}--all lists effects, drivers and the dwells that decide")
    else:
        for section in (sections.unseen, sections.unseen_in_part, sections.hidden_by_noise):
            print_section(section(document))
        print_next_measurement(document["next_measurements"])
    if data is not None:
        print_next_of_diagnosis(document, data, model)


def _picture(made: "Examination | None") -> None:
    if made is not None and made.diagnosis is not None:
        from pipelines.cli.text.effect_text import print_view
        from pipelines.report.effect_view import effect_views

        print_view(effect_views(made.diagnosis, made.sound)[0])


def print_findings(document: DiagnosisDocument, *, brief: bool = False) -> None:
    """Print the drivers that the residual follows, the classes of missing effects, and the dwells that decide.

    brief : the classes alone, and why the first effect of each is proposed
    """
    if not brief:
        print_section(sections.drivers(document))
    print_section(sections.missing(document))
    for text in (*sentences.why_first(document), *sentences.why_recommended(document)):
        say(text)
    if text := sentences.without_single_dwells(document):
        say(text)
    _dim(sentences.tails_left_out(document))
    if not brief:
        for text in sentences.influences(document):
            _dim(text)
    warn(document.get("warnings", ()))


def print_next_measurement(proposed: Sequence[NextMeasurement], out: Console | None = None) -> None:
    """Print the next measurement step by step, on standard output where ``out`` is None."""
    print_section(sections.next_measurement(proposed), out)


def print_section(section: Section, out: Console | None = None) -> None:
    """Print a table with its sentences; no table without rows."""
    if section.rows:
        print_table(section.heads("\n"), section.rows, title=section.title, out=out)
    for text in section.notes:
        (out or console()).print(text, style="dim")


def _dim(text: str) -> None:
    """Print a sentence of second rank; nothing where it is empty."""
    if text:
        say(text, style="dim")


def _unexplained(document: DiagnosisDocument, model: Path | None) -> None:
    if not document["unexplained"]:
        return
    say(f"{sentences.UNEXPLAINED}: {sentences.unexplained_text(document)}")
    if offer := document["offer"]:
        say(f"Formula for {model or 'a model file'}, to be refined:\n")
        say(offer["toml"])
