"""Checks of an archive: every hash computed anew, every manifest held against those that name it."""

from pipelines.integrity.archive import Report, verify
from pipelines.integrity.findings import IntegrityFinding

__all__ = ["IntegrityFinding", "Report", "verify"]
