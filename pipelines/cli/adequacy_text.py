"""The verdicts on the model of a run and on its stated references behind its result: as keys of the document, and as lines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.cli.options import console, error_console
from pipelines.jobs.adequacy import adequacy_of
from pipelines.jobs.references import contradiction, references_of, unseen

if TYPE_CHECKING:
    from pipelines.archive import Run
    from pipelines.jobs.adequacy import AdequacyDocument
    from pipelines.jobs.references import ReferencesDocument


def judged(document: dict[str, Any], run: Run) -> dict[str, Any]:
    """The result of a run with the verdicts on its model and on its stated references."""
    with error_console().status("judging the model"):
        return {**document, "adequacy": adequacy_of(run), "references": references_of(run)}


def print_adequacy(verdict: AdequacyDocument | None) -> None:
    """Print whether the model of a run is adequate; nothing where there is no multi-position test."""
    if verdict is None:
        return
    from pipelines.cli.verdict_text import STYLE_OF, plain_verdict

    faulty = f"; left out because of a data fault: {', '.join(verdict['faulty'])}" if verdict["faulty"] else ""
    text = f"model   {plain_verdict(verdict)}{faulty}"
    console().print(text, style=STYLE_OF[verdict["adequate"]], markup=False, soft_wrap=True)


def print_references(judged: ReferencesDocument | None) -> None:
    """Print whether the table is worse than stated, and what the run cannot show; nothing where nothing is stated."""
    if judged is None:
        return
    if judged["worse"] is None:
        text = f"CANNOT BE JUDGED: {judged['reason']}"
    else:
        told = f"CONTRADICTED: {contradiction(judged)}" if judged["worse"] else "not contradicted by the residuals"
        text = f"{told}; {unseen(judged)}"
    console().print(
        f"stated references   {text}", style="bold red" if judged["worse"] else "", markup=False, soft_wrap=True
    )
