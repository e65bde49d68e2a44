"""All checks in their order, and the document of their results."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from importlib import metadata
from typing import TYPE_CHECKING

from pipelines.doctor.archive import archive_checks, key_checks
from pipelines.doctor.host import host_checks
from pipelines.doctor.orchestrator import orchestrator_checks
from pipelines.doctor.software import software_checks
from pipelines.doctor.station import station_checks
from schemas.shipped import PRODUCT, shipped

if TYPE_CHECKING:
    from pathlib import Path

    from pipelines.doctor.documents import CheckDocument, DoctorDocument

LEAST_FREE_GB = 1.0
"""Free space that an archive needs, GB, by default."""


def examine(archive: str | None = None, station: Path | None = None, free_gb: float = LEAST_FREE_GB) -> DoctorDocument:
    """The state of the installation and of what it is connected to.

    Parameters
    ----------
    archive : its address; the default one where None
    station : file of a station; none is checked where None
    free_gb : free space that the archive needs, GB
    """
    checks = [
        *software_checks(),
        *archive_checks(archive, free_gb),
        *key_checks(archive),
        *orchestrator_checks(),
        *station_checks(station),
        *host_checks(),
    ]
    rows: list[CheckDocument] = [
        {"part": c.part, "check": c.check, "state": c.state, "found": c.found, "needed": c.needed, "remedy": c.remedy}
        for c in checks
    ]
    samples = shipped("deploy")
    faults = sum(c.state == "fault" for c in checks)
    return {
        "ok": not faults,
        "faults": faults,
        "warnings": sum(c.state == "warning" for c in checks),
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": platform.node(),
        "version": metadata.version(PRODUCT),
        "python": platform.python_version(),
        "samples": None if samples is None else str(samples),
        "checks": rows,
    }
