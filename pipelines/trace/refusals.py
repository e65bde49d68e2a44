"""What speaks against a certificate although the unit passed: an overdue standard, a serial in two places at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.archive import Run, files
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.trace.ledger import Ledger

START, END = "run.json", "readings.json"


def refuse_overdue(run: Run) -> None:
    """Refuse a run whose station had a reference standard that was due before it measured."""
    about = run.about
    day = str(about.get("measured") or about["when"])[:10]
    for standard in (about.get("station") or {}).get("reference", []):
        if str(standard["due"]) <= day:
            message = (
                f"certify: run {run.id} was measured on {day}, reference standard {standard['id']} (certificate "
                f"{standard['certificate']}) was due on {standard['due']}; have it calibrated, enter its new certificate in the "
                "station's file, and measure again"
            )
            raise WrongUse(message)


def refuse_two_at_once(ledger: Ledger, run: Run, serial: str) -> None:
    """Refuse a unit that was measured somewhere else at the same time: two units have one serial."""
    own = _measured(run)
    for one in ledger.calibrations(serial):
        other = Run(run.archive, one.run)
        if (
            other.id == run.id
            or not (other.path / END).is_file()
            or other.about.get("capture") == run.about.get("capture")
        ):
            continue
        theirs = _measured(other)
        if own and theirs and own[0] < theirs[1] and theirs[0] < own[1]:
            message = (
                f"certify: unit {serial} was measured in run {run.id} from {own[0]} to {own[1]} and in run {other.id} from "
                f"{theirs[0]} to {theirs[1]}: two units have one serial; find out which is which, and give one another"
            )
            raise WrongUse(message)


def _measured(run: Run) -> tuple[str, str] | None:
    """When a run began and its capture ended; None where that is not known, or not of its own."""
    about = run.about
    if about.get("rerun_of") or not about.get("capture") or not (run.path / END).is_file():
        return None
    return str(files.read_json(run.path / START)["when"]), str(files.read_json(run.path / END)["when"])
