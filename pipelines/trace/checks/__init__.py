"""Checks of an archive: every hash computed anew, every manifest held against those that name it."""

from pipelines.trace.checks.archive import Report, verify
from pipelines.trace.checks.findings import Finding

__all__ = ["Finding", "Report", "verify"]
