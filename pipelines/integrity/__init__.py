"""Checks of an archive: every hash is computed again, every manifest is compared with the manifests that refer to it."""

from pipelines.integrity.archive import Report, verify
from pipelines.integrity.findings import IntegrityFinding

__all__ = ["IntegrityFinding", "Report", "verify"]
