"""The report of a run of any kind, captured or imported: each kind has a key of its own, of the code that makes it."""

from __future__ import annotations

from pipelines.archive import Run
from pipelines.report import TABLES
from pipelines.report import make_report as make_captured_report


def make_report(run: Run) -> bool:
    """Write the run's report if it is missing or older than its tables; return whether it was up to date."""
    if _captured(run):
        return make_captured_report(run)
    from pipelines.report.imported import make_imported_report  # loads the search for effects

    return make_imported_report(run)


def renew_report(run: Run) -> None:
    """Write an existing report again after a change of the ledger."""
    if (run.path / "report.json").is_file() and (not _captured(run) or set(TABLES) <= set(run.tables())):
        make_report(run)


def _captured(run: Run) -> bool:
    """Whether a run was measured on a station, or is one of a lot that was, not imported."""
    return bool(run.about.get("capture") or run.about.get("parents"))
