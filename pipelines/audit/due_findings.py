"""Findings about due units: units to recall, and certificates that contradict the measurements."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from inertial.arrays import Index
from inertial.counts import number_of
from pipelines.audit.audit import Audit
from pipelines.audit.calibrations import date_of
from pipelines.audit.due import uncertified
from pipelines.audit.finding import AuditFinding, some

REASONS = {  # reasons in a sentence about overdue units
    "certificate": "their certificate has ended",
    "fixed": "their interval is over",
    "drift": "they drift",
    "revoked": "their certificate was revoked",
    "did not pass": "they did not pass",
}


def of_certificates(audit: Audit) -> Iterator[AuditFinding]:
    """Contradictions between the ledger and the measurements."""
    yield from _held_but_failed(audit)
    yield from _uncertified(audit)


def of_what_is_due(audit: Audit) -> Iterator[AuditFinding]:
    """Overdue units, then units that come due."""
    yield from _overdue(audit)
    yield from _coming_due(audit)


def _held_but_failed(audit: Audit) -> Iterator[AuditFinding]:
    """Units that failed their last measurement and have a valid certificate, by kind of device."""
    own = audit.due
    for device, chosen in _by_device(audit, np.flatnonzero(own.valid & (own.because == "did not pass"))):
        units, certificates = _units(audit, chosen), tuple(str(one) for one in own.certificate[chosen])
        message = (
            f"{device}: {number_of(len(units), 'unit')} with a valid certificate did not pass the last measurement; "
            "revoke each certificate from the first doubtful day, and measure the unit again "
            f"({some(certificates)})"
        )
        runs = [str(run) for run in audit.all.run[own.row[chosen]]]
        evidence = {"certificates": list(certificates), "runs": runs}
        yield AuditFinding("quality", "held_but_failed", device, message, units, evidence)


def _uncertified(audit: Audit) -> Iterator[AuditFinding]:
    """Units that passed without a certificate for it, by kind of device; none in an archive without a ledger."""
    without_certificate = uncertified(audit.all, audit.due, audit.certificates)
    for device, own in _by_device(audit, without_certificate):
        units = _units(audit, own)
        without = int(np.count_nonzero(~audit.due.valid[own]))
        message = (
            f"{device}: {number_of(len(units), 'unit')} passed the last measurement without a certificate for it, {without} "
            f"without any valid certificate; certify their runs, or record the reason ({some(units)})"
        )
        runs = sorted({str(run) for run in audit.all.run[audit.due.row[own]]})
        yield AuditFinding("quality", "uncertified", device, message, units, {"without": without, "runs": runs})


def _overdue(audit: Audit) -> Iterator[AuditFinding]:
    for device, own in _by_device(audit, np.flatnonzero(audit.due.day < audit.scope.until)):
        units, oldest = _units(audit, own), date_of(float(audit.due.day[own].min()))
        counts = {why: int(np.count_nonzero(audit.due.because[own] == why)) for why in REASONS}
        because = ", ".join(f"{count} because {REASONS[why]}" for why, count in counts.items() if count)
        message = (
            f"{device}: {number_of(len(units), 'unit')} overdue ({because}), the first since {oldest}; "
            f"recall and calibrate ({some(units)})"
        )
        evidence = {"oldest": oldest, "because": {why: count for why, count in counts.items() if count}}
        yield AuditFinding("line", "overdue", device, message, units, evidence)


def _coming_due(audit: Audit) -> Iterator[AuditFinding]:
    until = audit.scope.until
    soon = np.flatnonzero((audit.due.day >= until) & (audit.due.day < until + audit.rules.notice_days))
    for device, own in _by_device(audit, soon):
        units = _units(audit, own)
        message = (
            f"{device}: {number_of(len(units), 'unit')} due within {audit.rules.notice_days} days; "
            f"schedule the calibration ({some(units)})"
        )
        yield AuditFinding("line", "due", device, message, units)


def _by_device(audit: Audit, chosen: Index) -> Iterator[tuple[str, Index]]:
    """Indices into the due units, by kind of device."""
    devices = audit.all.device[audit.due.row[chosen]].astype(str)
    for device in np.unique(devices):
        yield str(device), chosen[devices == device]


def _units(audit: Audit, own: Index) -> tuple[str, ...]:
    return tuple(str(unit) for unit in audit.all.unit[audit.due.row[own]])
