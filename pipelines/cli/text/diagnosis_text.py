"""A diagnosis for people: the verdict in a sentence, then data faults, drivers, classes, the next command, hidden effects."""

from pathlib import Path
from typing import Any

from rich.console import Console

from pipelines.cli.next_commands import FindData, command_line, print_extension, print_next
from pipelines.cli.printing import console, print_table, say, warn
from pipelines.cli.text.verdict_text import print_verdict
from pipelines.diagnosis import sections, sentences
from pipelines.diagnosis.sections import Section


def print_diagnosis(document: dict[str, Any], *, data: FindData | None, model: Path | None, brief: bool = True) -> None:
    """Print a diagnosis.

    data : gives the data as they were named on the command line, where commands to give next are printed; None: none are printed
    model : the model file as it was given there
    brief : one sentence counts the effects of quantities that were not recorded
    """
    print_verdict(document)
    _dim(sentences.evidence_text(document))
    if sentences.few_dwells(document):
        _dim(sentences.undetected(document))
    print_findings(document)
    _unexplained(document, data, model)
    if data is not None and document["recommended"]:
        print_extension(document, data, model)
        _dim(sentences.not_separated(document))
    if document["unseen"]:
        say()
    print_section(sections.unseen(document, brief=brief))
    for section in (sections.unseen_in_part, sections.hidden_by_noise):
        print_section(section(document))
    print_next_measurement(document["next_measurements"])


def print_findings(document: dict[str, Any]) -> None:
    """Print data faults, the drivers that the residual follows, the classes of missing effects, and the dwells that decide."""
    for section in (sections.faults, sections.drivers, sections.missing):
        print_section(section(document))
    for text in sentences.why_recommended(document):
        say(text)
    if text := sentences.without_single_dwells(document):
        say(text)
    _dim(sentences.tails_left_out(document))
    for text in sentences.influences(document):
        _dim(text)
    warn(document.get("warnings", ()))


def print_next_measurement(proposed: list[dict[str, Any]], out: Console | None = None) -> None:
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


def _unexplained(document: dict[str, Any], data: FindData | None, model: Path | None) -> None:
    if not document["unexplained"]:
        return
    say(f"\n{sentences.UNEXPLAINED}: {sentences.unexplained_text(document)}")
    if offer := document["offer"]:
        say(f"Formula for {model or 'a model file'}, to be refined:\n")
        say(offer["toml"])
        if data is not None:  # the command that judges the model with it, without a model file
            found, effects = data(), ",".join([*document["effects"], offer["id"]])
            formula = f"{offer['id']}={'; '.join(offer['columns'])}"
            words = ("--effects", effects, *found.given.written, "--formula", formula)
            print_next([command_line("diagnose", found.source, *words, *found.options)])
