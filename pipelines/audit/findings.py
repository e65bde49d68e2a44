"""All findings, sorted by who must act."""

from __future__ import annotations

from pipelines.audit.audit import Audit
from pipelines.audit.calibrations import date_of
from pipelines.audit.due_findings import of_certificates, of_what_is_due
from pipelines.audit.finding import WHO, AuditFinding
from pipelines.audit.population_findings import of_population
from pipelines.audit.station_findings import of_stations
from pipelines.audit.unit_findings import of_units


def findings(audit: Audit) -> list[AuditFinding]:
    """All findings: quality first; for each role the most serious kind first."""
    collected = [
        *of_units(audit),
        *of_certificates(audit),
        *of_stations(audit),
        *of_what_is_due(audit),
        *of_population(audit),
        *(_unreadable(run, text) for run, text in audit.problems),
        *(_later(run, day) for run, day in audit.later),
        *(_broken(folder, text) for folder, text in audit.certificates.problems.items()),
    ]
    order = list(WHO)
    return sorted(collected, key=lambda finding: order.index(finding.who))


def _unreadable(run: str, text: str) -> AuditFinding:
    message = f"run {run} was left out: {text}; see 'tumbleline verify', then restore it from a copy"
    return AuditFinding("archive", "unreadable", run, message)


def _later(run: str, day: float) -> AuditFinding:
    message = (
        f"run {run} was left out: its date of measurement {date_of(day)} is in the future; set the clock of the "
        "host that wrote it, and measure the units again"
    )
    return AuditFinding("archive", "clock", run, message, (), {"date": date_of(day)})


def _broken(folder: str, text: str) -> AuditFinding:
    return AuditFinding("archive", "ledger", folder, f"the certificates of one unit were left out: {folder} {text}")
