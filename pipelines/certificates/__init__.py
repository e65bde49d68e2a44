"""Certificates: which calibration of a unit was valid on a date, its origin, and whether its files are unchanged."""

from pipelines.certificates.entries import LedgerEntry
from pipelines.certificates.ledger import Ledger
from pipelines.certificates.validity import Calibration

__all__ = ["Calibration", "Ledger", "LedgerEntry"]
