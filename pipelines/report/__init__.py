"""The report for people: one HTML file per run that opens without a network."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipelines.archive import Run, code_hash, stage_key
from pipelines.certificates.ledger import stated
from pipelines.certificates.validity import Calibration
from pipelines.report.context import OPTIONAL, TABLES, ReportContext
from pipelines.report.interactive import interactive as with_scripts
from pipelines.report.panel import rendered
from pipelines.report.templates import page_hash, template
from schemas.errors import WrongUse

__all__ = ["TABLES", "make_report", "render"]

PANELS = "pipelines.report.panels"


def render(run: Run, certificates: Mapping[str, Calibration] | None = None) -> str:
    """The report of a run as one HTML text that needs no other file, of the panels that are found.

    Parameters
    ----------
    certificates : of the run's units, in their present state in the ledger.
    """
    panels = rendered(PANELS, ReportContext(run, certificates or {}))
    return with_scripts(template("page.html").render(run=run.id, panels=panels))


def make_report(run: Run) -> bool:
    """Write the report of a captured run if it is missing or older than its tables; return whether it was up to date."""
    if run.about.get("parents") and run.report.is_file():
        return True  # a follow-up has no decisions: its report is the diagnosis of all runs together
    _refuse_unfinished(run)
    names = [*TABLES, *(name for name in ("history", *OPTIONAL) if name in run.tables())]
    inputs, code = {name: run.manifest(name)["sha256"] for name in names}, code_hash("report")
    certificates = stated(run, run.table("grades")["unit"])
    parameters: dict[str, Any] = {"page": page_hash()}  # the code's hash has no templates
    if certificates:
        parameters["certificates"] = {unit: one.stated() for unit, one in sorted(certificates.items())}
    key = stage_key("report", inputs, parameters, code)
    if run.has_report(key):
        run.seal()  # a killed writer may not have written it
        return True
    run.save_report(key, render(run, certificates), {"inputs": inputs, "parameters": parameters, "code": code})
    return False


def _refuse_unfinished(run: Run) -> None:
    """Refuse a report on a run without decisions."""
    missing = [name for name in TABLES if name not in run.tables()]
    if missing:
        raise WrongUse(
            f"report: run {run.id} has no {', '.join(missing)}; it is not finished: give its 'tumbleline run' again to continue"
        )
