"""The measurement that a run analyses: its identity, its start and its end."""

from pipelines.archive import Run, files
from pipelines.certificates.days import day_of

START, END = "run.json", "readings.json"


def measurement_of(run: Run) -> str:
    """An identifier common to all analyses of one measurement: its capture, else the imported file, else the run."""
    about = run.about
    source = (about.get("source") or {}).get("sha256")
    return str(about.get("capture") or source or about.get("rerun_of") or run.id)


def same_measurement(run: Run, other: str) -> bool:
    """Whether another run of the archive analyses the measurement of this one; False where the archive lacks it."""
    if other == run.id:
        return True
    its = Run(run.archive, other)
    return (its.path / START).is_file() and measurement_of(its) == measurement_of(run)


def measured_span(run: Run) -> tuple[str, str] | None:
    """Start of a run and end of its capture; None where unknown, or where the capture belongs to another run."""
    about = run.about
    if _analysed_again(run) is not None or not about.get("capture") or not (run.path / END).is_file():
        return None
    return str(files.read_json(run.path / START)["when"]), str(files.read_json(run.path / END)["when"])


def measured_on(run: Run) -> str:
    """The day on which the measurement of a run ended, UTC; for a re-run and for imported data the stated day."""
    first = _analysed_again(run)
    if first is not None:
        return day_of(first, f"run {run.id}")
    span, about = measured_span(run), run.about
    return day_of(span[1] if span else str(about.get("measured") or about["when"]), f"run {run.id}")


def _analysed_again(run: Run) -> str | None:
    """Time at which the data of a re-analysis were measured; None for a run with its own measurement, or an import.

    A re-fit by an older version does not state the run that it analyses again; it is recognised by a start after the last event
    of its capture.
    """
    about, records = run.about, run.records
    if about.get("rerun_of"):
        return str(about.get("measured") or about["when"])
    events = records.events.documents() if records is not None and records.is_complete() else []
    times = sorted(str(event["when"]) for event in events)
    return times[0] if times and str(about["when"]) > times[-1] else None
