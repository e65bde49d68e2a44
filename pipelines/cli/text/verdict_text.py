"""The verdict on the model of a run, and on its stated references, for people."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pipelines.archive import Run
from pipelines.cli.printing import error_console, say

if TYPE_CHECKING:
    from pipelines.diagnosis.documents import DiagnosisDocument
    from pipelines.jobs.references import ReferencesDocument
    from pipelines.stages.judge import AdequacyDocument


STYLE_OF = {True: "bold green", False: "bold red", None: "bold yellow"}  # style of a verdict; None: it cannot be judged


def print_verdict(document: "DiagnosisDocument") -> None:
    """Print the verdict of a diagnosis."""
    from pipelines.diagnosis.sentences import verdict

    say(verdict(document), STYLE_OF[document["adequate"]])


def print_verdict_of_fit(adequate: bool | None, not_adequate: str, faulty: Sequence[str] = ()) -> None:
    """Print whether a fit is adequate, else what is wrong, and the units with a data fault, to which it does not apply."""
    texts = {True: "adequate", False: f"NOT ADEQUATE: {not_adequate}", None: "CANNOT BE JUDGED: see above"}
    without = f"; do not use {', '.join(faulty)}: not judged, because of a data fault" if faulty else ""
    say(f"  {texts[adequate]}{without}", STYLE_OF[None if faulty and adequate else adequate])


def judged(document: dict[str, Any], run: Run) -> dict[str, Any]:
    """The result of a run with the verdicts on its model and on its stated references."""
    from pipelines.jobs.adequacy import adequacy_of
    from pipelines.jobs.references import references_of

    with error_console().status("judging the model"):
        return {**document, "adequacy": adequacy_of(run), "references": references_of(run)}


def print_adequacy(verdict: "AdequacyDocument | None") -> None:
    """Print whether the model of a run is adequate; nothing where there is no multi-position test."""
    if verdict is None:
        return
    from pipelines.diagnosis.sentences import plain_verdict

    faulty = f"; left out because of a data fault: {', '.join(verdict['faulty'])}" if verdict["faulty"] else ""
    text = f"model   {plain_verdict(verdict)}{faulty}"
    say(text, style=STYLE_OF[verdict["adequate"]])


def print_references(judged: "ReferencesDocument | None") -> None:
    """Print whether the table is worse than stated, and what the run cannot show; nothing where nothing is stated."""
    from pipelines.jobs.references import contradiction, unseen

    if judged is None:
        return
    if judged["worse"] is None:
        text = f"CANNOT BE JUDGED: {judged['reason']}"
    else:
        told = f"CONTRADICTED: {contradiction(judged)}" if judged["worse"] else "the residuals agree with them"
        text = f"{told}; {unseen(judged)}"
    say(f"stated references   {text}", style="bold red" if judged["worse"] else "")
