"""The report for people: one HTML file per run that opens without a network."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.archive import code_hash, stage_key
from pipelines.report.page import render

if TYPE_CHECKING:
    from pipelines.archive import Run

__all__ = ["INPUTS", "make_report", "render"]

INPUTS = ("verdicts", "dwells", "coefficients", "residuals", "verification", "allan", "noise", "figures", "grades")
MODULES = ("schemas.limits", "schemas.tables", "pipelines.report")


def make_report(run: Run) -> bool:
    """Whether the run's report was there already, made from its tables as they are; it is now."""
    inputs, code = {name: run.manifest(name)["sha256"] for name in INPUTS}, code_hash(MODULES)
    key = stage_key("report", inputs, {}, code)
    if run.has_report(key):
        return True
    run.save_report(key, render(run), {"inputs": inputs, "parameters": {}, "code": code})
    return False
