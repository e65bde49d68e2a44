"""Trace: which calibration of a unit held on a date, from what it came, and whether all of it is unchanged."""

from pipelines.trace.events import Event
from pipelines.trace.ledger import Ledger
from pipelines.trace.validity import Calibration

__all__ = ["Calibration", "Event", "Ledger"]
