"""When the measurement of a run began and was over."""

from __future__ import annotations

from pipelines.archive import Run, files
from pipelines.certificates.days import day_of

START, END = "run.json", "readings.json"


def measured_span(run: Run) -> tuple[str, str] | None:
    """When a run began and its capture ended; None where that is not known, or not of its own."""
    about = run.about
    if about.get("rerun_of") or not about.get("capture") or not (run.path / END).is_file():
        return None
    return str(files.read_json(run.path / START)["when"]), str(files.read_json(run.path / END)["when"])


def measured_on(run: Run) -> str:
    """The day on which a run's measurement was over, UTC; of a run again, and of data of others, the one that it tells."""
    own, about = measured_span(run), run.about
    return day_of(own[1] if own else str(about.get("measured") or about["when"]), f"run {run.id}")
