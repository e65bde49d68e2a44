"""The verdict on a model in a sentence, with its numbers and the names of what is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from inertial.uncertainty.rounding import equal
from pipelines.archive import Run
from pipelines.cli.options import console, error_console, short
from pipelines.tables.sound_lot import SMALL_MISFIT, is_small

if TYPE_CHECKING:
    from pipelines.jobs.adequacy import AdequacyDocument
    from pipelines.jobs.references import ReferencesDocument


STYLE_OF = {True: "bold green", False: "bold red", None: "bold yellow"}
"""Style of a verdict; None: it cannot be judged."""


def verdict(document: dict[str, Any]) -> str:
    """The verdict in one sentence with its numbers."""
    error, faulty = document["error"], {u for f in document["blocked_by"] for u in f["units"]}
    if error["rms_ug"] is None:
        return (
            f"CANNOT BE JUDGED: every unit ({len(faulty)}) has a data fault; correct the faults, then judge the model."
        )
    judged = {"adequate": document["adequate"], "reason": document.get("reason"), **error}
    told = plain_verdict({**judged, "units": len(document["units"]) - len(faulty)})
    if document["adequate"] is not False:
        return f"{told}."
    spoilt = [class_text(group) for group in document["classes"] if group["scope"] == "data"]
    named = [" or ".join(group["effects"]) for group in document["classes"] if group["scope"] != "data"]
    if spoilt:
        rest = f"; also missing: {', and '.join(named)}" if named else ""
        return f"{told}; these figures are without the faults of the data: {'; '.join(spoilt)}{rest}."
    if named:
        return f"{told}; missing: {', and '.join(named)}."
    rest = "no recorded quantity explains the residual"
    if document["unexplained"]:
        rest = f"{document['unexplained']['text']}, and no effect of the catalogue explains it"
    return f"{told}; {rest}."


def plain_verdict(judged: Mapping[str, Any]) -> str:
    """The verdict with residual, noise and probability, without a full stop.

    Parameters
    ----------
    judged : ``adequate``, ``reason``, ``rms_ug``, ``floor_ug``, ``p_value`` and ``units``, the number of units that were judged
    """
    if judged["adequate"] is None:
        return f"CANNOT BE JUDGED: {judged['reason']}"
    units = judged["units"]
    left = f"residual {short(judged['rms_ug'])} µg rms over {units} unit{'s' if units != 1 else ''}"
    left += f"; noise of the measurement {short(judged['floor_ug'])} µg rms (p {equal(judged['p_value'])})"
    if judged["adequate"]:
        return f"ADEQUATE: {left}"
    return f"NOT ADEQUATE: {left}{f'; {SMALL_MISFIT}' if is_small(judged) else ''}"


def class_text(group: dict[str, Any]) -> str:
    """A handling error with its unit and first dwell, and the effects that explain the data equally well."""
    units, dwells = group.get("units") or [], group.get("dwells") or []
    where = f"{', '.join(units) or 'all units'}{f', dwell {dwells[0]}' if dwells else ''}"
    return f"{' or '.join(group['effects'])} ({where})"


def judged(document: dict[str, Any], run: Run) -> dict[str, Any]:
    """The result of a run with the verdicts on its model and on its stated references."""
    from pipelines.jobs.adequacy import adequacy_of
    from pipelines.jobs.references import references_of

    with error_console().status("judging the model"):
        return {**document, "adequacy": adequacy_of(run), "references": references_of(run)}


def print_adequacy(verdict: AdequacyDocument | None) -> None:
    """Print whether the model of a run is adequate; nothing where there is no multi-position test."""
    if verdict is None:
        return
    faulty = f"; left out because of a data fault: {', '.join(verdict['faulty'])}" if verdict["faulty"] else ""
    text = f"model   {plain_verdict(verdict)}{faulty}"
    console().print(text, style=STYLE_OF[verdict["adequate"]], soft_wrap=True)


def print_references(judged: ReferencesDocument | None) -> None:
    """Print whether the table is worse than stated, and what the run cannot show; nothing where nothing is stated."""
    from pipelines.jobs.references import contradiction, unseen

    if judged is None:
        return
    if judged["worse"] is None:
        text = f"CANNOT BE JUDGED: {judged['reason']}"
    else:
        told = f"CONTRADICTED: {contradiction(judged)}" if judged["worse"] else "not contradicted by the residuals"
        text = f"{told}; {unseen(judged)}"
    console().print(f"stated references   {text}", style="bold red" if judged["worse"] else "")
