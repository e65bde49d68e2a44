"""Start and end of the measurement of a run."""

from __future__ import annotations

from pipelines.archive import Run, files
from pipelines.certificates.days import day_of

START, END = "run.json", "readings.json"


def measured_span(run: Run) -> tuple[str, str] | None:
    """Start of a run and end of its capture; None where unknown, or where the capture belongs to another run."""
    about = run.about
    if about.get("rerun_of") or not about.get("capture") or not (run.path / END).is_file():
        return None
    return str(files.read_json(run.path / START)["when"]), str(files.read_json(run.path / END)["when"])


def measured_on(run: Run) -> str:
    """The day on which the measurement of a run ended, UTC; for a re-run and for imported data the stated day."""
    own, about = measured_span(run), run.about
    return day_of(own[1] if own else str(about.get("measured") or about["when"]), f"run {run.id}")
