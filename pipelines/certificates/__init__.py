"""Trace: which calibration of a unit held on a date, from what it came, and whether all of it is unchanged."""

from pipelines.certificates.entries import LedgerEntry
from pipelines.certificates.ledger import Ledger
from pipelines.certificates.validity import Calibration

__all__ = ["Calibration", "Ledger", "LedgerEntry"]
