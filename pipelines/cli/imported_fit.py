"""``tumbleline fit`` of an import: a model fitted to its dwells, with the verdict and its basis."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipelines.archive import Archive, Run
from pipelines.cli.printing import error_console, give, say
from pipelines.cli.text.verdict_text import print_verdict_of_fit
from schemas.errors import DONE, PART_FAILED


def fit_import(run: Run, change: tuple[str, Path | None, str], leave_out: str, *, as_json: bool) -> int:
    """Fit a model to an import, keep it as a run of its own and print it; the exit status.

    Parameters
    ----------
    change : effects, model file and limits; empty or None if not given
    leave_out : dwells as UNIT:DWELL,…
    """
    from pipelines.jobs.model_change import change_from_options
    from pipelines.rerun.imported_fit import fit_document
    from pipelines.rerun.rerun import again
    from pipelines.tables.leave_out import named_dwells

    effects, model, limits = change
    with error_console().status("fitting and judging"):
        outcome = again(
            Archive(run.archive.root),
            run.id,
            change_from_options(effects, model, limits, where="fit"),
            left_out=named_dwells(leave_out),
        )
        done = Archive(run.archive.root).run(outcome.new)
        document = fit_document(done, run.id)
    give(document, _print, as_json=as_json)
    passed = all(unit["outcome"] == "pass" for unit in document["units"])
    return DONE if document["adequate"] is True and passed else PART_FAILED


def _print(document: dict[str, Any]) -> None:
    left = f", without {', '.join(document['left_out'])}" if document["left_out"] else ""
    model = ", ".join(document["effects"]) or "axes in the plane"
    say(f"{model}{left}: kept as run {document['run']}")
    for line in document["lines"]:
        say(f"  {line}")
    for unit in document["units"]:
        reasons = f" ({unit['reasons']})" if unit["reasons"] else ""
        say(f"  {unit['unit']}: {unit['outcome']}, grade {unit['grade']}{reasons}")
    print_verdict_of_fit(document["adequate"], "this model does not describe these data")
