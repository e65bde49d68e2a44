"""The verdict on the model of a run behind its result: as a key of the document, and as a line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.cli.options import console, error_console
from pipelines.jobs.adequacy import adequacy_of

if TYPE_CHECKING:
    from pipelines.archive import Run
    from pipelines.jobs.adequacy import AdequacyDocument


def judged(document: dict[str, Any], run: Run) -> dict[str, Any]:
    """The result of a run with the verdict on its model."""
    with error_console().status("judging the model"):
        return {**document, "adequacy": adequacy_of(run)}


def print_adequacy(verdict: AdequacyDocument | None) -> None:
    """Print whether the model of a run is adequate; nothing where there is no multi-position test."""
    if verdict is None:
        return
    from pipelines.cli.text.verdict_text import STYLE_OF, plain_verdict

    faulty = f"; left out because of a data fault: {', '.join(verdict['faulty'])}" if verdict["faulty"] else ""
    text = f"model   {plain_verdict(verdict)}{faulty}"
    console().print(text, style=STYLE_OF[verdict["adequate"]], markup=False, soft_wrap=True)
