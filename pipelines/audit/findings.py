"""All findings, sorted by who must act; here those about certificates, due units, the population and the archive."""

from collections.abc import Iterator

import numpy as np

from inertial.arrays import Index
from inertial.counts import number_of
from inertial.uncertainty.rounding import equal
from pipelines.audit.audit import Audit
from pipelines.audit.calibrations import date_of
from pipelines.audit.due import uncertified
from pipelines.audit.finding import WHO, AuditFinding, some
from pipelines.audit.parameters import parameter_text, unit_text
from pipelines.audit.station_findings import of_stations
from pipelines.audit.unit_findings import of_units
from pipelines.report.numbers import significant
from pipelines.stages.figures import figure_label

TELLING_EFFECT = 0.02  # smaller shares of the variance between groups are not relevant
DIFFERENT_P = 1e-3
REASONS = {  # reasons in a sentence about overdue units
    "certificate": "their certificate has ended",
    "fixed": "their interval is over",
    "drift": "they drift",
    "revoked": "their certificate was revoked",
    "did not pass": "they did not pass",
}


def findings(audit: Audit) -> list[AuditFinding]:
    """All findings: quality first; for each role the most serious kind first."""
    collected = [
        *of_units(audit),
        *_held_but_failed(audit),
        *_uncertified(audit),
        *of_stations(audit),
        *_overdue(audit),
        *_coming_due(audit),
        *_odd(audit),
        *_incapable(audit),
        *_different(audit),
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


def _held_but_failed(audit: Audit) -> Iterator[AuditFinding]:
    """Units that failed their last measurement and have a valid certificate, by kind of device."""
    due_units = audit.due
    for device, chosen in _by_device(audit, np.flatnonzero(due_units.valid & (due_units.because == "did not pass"))):
        units, certificates = _units(audit, chosen), tuple(str(number) for number in due_units.certificate[chosen])
        message = (
            f"{device}: {number_of(len(units), 'unit')} with a valid certificate did not pass the last measurement; "
            "revoke each certificate from the first doubtful day, and measure the unit again "
            f"({some(certificates)})"
        )
        runs = [str(run) for run in audit.all.run[due_units.row[chosen]]]
        evidence = {"certificates": list(certificates), "runs": runs}
        yield AuditFinding("quality", "held_but_failed", device, message, units, evidence)


def _uncertified(audit: Audit) -> Iterator[AuditFinding]:
    """Units that passed without a certificate for it, by kind of device; none in an archive without a ledger."""
    for device, chosen in _by_device(audit, uncertified(audit.all, audit.due, audit.certificates)):
        units = _units(audit, chosen)
        without = int(np.count_nonzero(~audit.due.valid[chosen]))
        message = (
            f"{device}: {number_of(len(units), 'unit')} passed the last measurement without a certificate for it, {without} "
            f"without any valid certificate; certify their runs, or record the reason ({some(units)})"
        )
        runs = sorted({str(run) for run in audit.all.run[audit.due.row[chosen]]})
        yield AuditFinding("quality", "uncertified", device, message, units, {"without": without, "runs": runs})


def _overdue(audit: Audit) -> Iterator[AuditFinding]:
    for device, chosen in _by_device(audit, audit.overdue):
        units, oldest = _units(audit, chosen), date_of(float(audit.due.day[chosen].min()))
        all_counts = {why: int(np.count_nonzero(audit.due.because[chosen] == why)) for why in REASONS}
        counts = {why: count for why, count in all_counts.items() if count}
        because = ", ".join(f"{count} because {REASONS[why]}" for why, count in counts.items())
        message = (
            f"{device}: {number_of(len(units), 'unit')} overdue ({because}), the first since {oldest}; "
            f"recall and calibrate ({some(units)})"
        )
        yield AuditFinding("line", "overdue", device, message, units, {"oldest": oldest, "because": counts})


def _coming_due(audit: Audit) -> Iterator[AuditFinding]:
    for device, chosen in _by_device(audit, audit.coming_due):
        units = _units(audit, chosen)
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


def _units(audit: Audit, chosen: Index) -> tuple[str, ...]:
    return tuple(str(unit) for unit in audit.all.unit[audit.due.row[chosen]])


def _odd(audit: Audit) -> Iterator[AuditFinding]:
    for odd in audit.odd:
        what = f"lot of run {odd.run} ({number_of(odd.units, 'unit')})" if odd.kind == "lot" else f"unit {odd.name}"
        text = unit_text(odd.parameter)
        message = (
            f"{odd.device}: {what} of {date_of(odd.day)} is an outlier in {parameter_text(odd.parameter)}: "
            f"{significant(odd.value, 4)} {text}, "
            f"{odd.z:+.1f} σ from its kind; look for a change in its production"
        )
        evidence = {"run": odd.run, "station": odd.station, "parameter": odd.parameter, "value": odd.value, "z": odd.z}
        yield AuditFinding(
            "product", f"odd_{odd.kind}", odd.name, message, (odd.name,) if odd.kind == "unit" else (), evidence
        )


def _incapable(audit: Audit) -> Iterator[AuditFinding]:
    for able in audit.abilities:
        if able.ppk.low < audit.rules.ppk_least:
            limit = f"{able.limit:g}" if able.unit_text == "1" else f"{able.limit:g} {able.unit_text}"
            more = "measure more units, " if able.ppk.value >= audit.rules.ppk_least else ""
            message = (
                f"{able.device}: {figure_label(able.figure)} has Ppk {able.ppk.value:.2f} (95 % interval {able.ppk.low:.2f} to "
                f"{able.ppk.high:.2f}, whose lower end must be at least {audit.rules.ppk_least:g}) against {limit}; "
                f"{100 * able.outside.value:.2g} % are outside: {more}reduce the spread, or widen the limit"
            )
            evidence = {"figure": able.figure, "ppk": able.ppk.value, "low": able.ppk.low, "high": able.ppk.high}
            yield AuditFinding("product", "capability", able.device, message, (), {**evidence, "n": able.n})


def _different(audit: Audit) -> Iterator[AuditFinding]:
    for difference in audit.differences:
        if difference.by != "lot" and difference.p < DIFFERENT_P and difference.comparison.effect > TELLING_EFFECT:
            message = (
                f"{difference.device}: {difference.figure} differs between {difference.by}s: "
                f"{100 * difference.comparison.effect:.0f} % of its variance, p {equal(difference.p)} over "
                f"{difference.comparison.groups} {difference.by}s; find out which, and why"
            )
            who = "station" if difference.by in {"station", "slot"} else "product"
            evidence = {
                "figure": difference.figure,
                "by": difference.by,
                "share": difference.comparison.effect,
                "p_value": difference.p,
            }
            yield AuditFinding(who, f"differs_by_{difference.by}", difference.device, message, (), evidence)
