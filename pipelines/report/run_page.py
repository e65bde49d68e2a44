"""The report of a run: one page composed of the panels that are found."""

from __future__ import annotations

from collections.abc import Mapping

from pipelines.archive import Run
from pipelines.certificates.statement import Stated
from pipelines.report.context import ReportContext
from pipelines.report.interactive import interactive
from pipelines.report.panel import rendered
from pipelines.report.templates import template

PANELS = "pipelines.report.panels"


def render(run: Run, certificates: Mapping[str, Stated] | None = None) -> str:
    """The report of a run as one HTML text that needs no other file.

    Parameters
    ----------
    certificates : of the run's units, in their present state in the ledger.
    """
    panels = rendered(PANELS, ReportContext(run, certificates or {}))
    return interactive(template("page.html").render(run=run.id, panels=panels))
