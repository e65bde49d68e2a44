"""Findings: what somebody must do something about, sorted by who that is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.audit.calibrations import date_of
from pipelines.audit.parameters import unit_text
from pipelines.audit.statistics.comparison import outlier_limit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pipelines.audit.audit import Audit
    from pipelines.audit.drifts import UnitDrift
    from pipelines.audit.stations_over_time import Series
    from pipelines.audit.statistics.change_points import Change

WHO = {  # in the order in which they are told
    "quality": "quality: certificates and units outside",
    "station": "whoever keeps the stations",
    "line": "the line: units to measure",
    "product": "engineering of the product",
    "archive": "whoever keeps the archive",
}
BEYOND = 1.0
TELLING_EFFECT = 0.02  # share of the variance between groups, below which a difference matters to nobody
DIFFERENT_P = 1e-3
MORE = 20  # units named in a sentence's list


@dataclass(frozen=True)
class Finding:
    """One thing to do.

    who : a key of :data:`WHO`; kind : of the finding, for machines; subject : what it is about
    units : serials concerned; evidence : the numbers behind it
    """

    who: str
    kind: str
    subject: str
    message: str
    units: tuple[str, ...] = ()
    evidence: dict[str, Any] = field(default_factory=dict[str, Any])


def findings(audit: Audit) -> list[Finding]:
    """All findings: those of quality first, within one person's the weightiest kind first."""
    found = [
        *_exchanged(audit),
        *_out_of_tolerance(audit),
        *_leaving(audit),
        *_unlike_their_kind(audit),
        *_moved_stations(audit),
        *_moved_slots(audit),
        *_standards(audit),
        *_gauges(audit),
        *_overdue(audit),
        *_coming_due(audit),
        *_odd(audit),
        *_incapable(audit),
        *_different(audit),
        *(_unreadable(run, text) for run, text in audit.problems),
    ]
    order = list(WHO)
    return sorted(found, key=lambda finding: order.index(finding.who))


def _unreadable(run: str, text: str) -> Finding:
    message = f"run {run} was left out: {text}; see 'tumbleline verify', then restore it from a copy"
    return Finding("archive", "unreadable", run, message)


def _exchanged(audit: Audit) -> Iterator[Finding]:
    for one in audit.strangers:
        unit, run, day = (str(getattr(audit.all, n)[one.row]) for n in ("unit", "run", "day"))
        evidence = {"run": run, "date": date_of(float(day)), "distance": one.distance, "looks_like": one.looks_like}
        if one.looks_like:
            how = "and the other way round" if one.exchanged else "whose own calibration of that day is another"
            message = (
                f"{unit} of {date_of(float(day))} (run {run}) does not fit its past, it fits {one.looks_like}, {how}: "
                "serials were exchanged; read both labels, revoke the certificates and certify anew"
            )
            yield Finding("quality", "exchanged", unit, message, (unit, one.looks_like), evidence)
        else:
            message = (
                f"{unit} of {date_of(float(day))} (run {run}) does not fit its past, nor that of any other unit: it was "
                "damaged, or its serial is wrong; measure it again"
            )
            yield Finding("quality", "foreign", unit, message, (unit,), evidence)


def _out_of_tolerance(audit: Audit) -> Iterator[Finding]:
    """Units found outside at their re-calibration, by more than the uncertainty of both: what they measured is in doubt."""
    for drift in _each(audit):
        expanded = abs(drift.change / drift.e_n) if drift.e_n else np.inf
        if drift.day >= audit.scope.since and abs(drift.change) - expanded > drift.tolerance:
            text = unit_text(drift.parameter)
            message = (
                f"{drift.unit}: {drift.parameter} was {drift.change:+.4g} {text} off after {12 * drift.years:.0f} months, "
                f"tolerance {drift.tolerance:g} {text}, U {expanded:.3g}, E_n {drift.e_n:+.1f}; what it measured since "
                f"{_before(drift)} is in doubt: tell whoever used it"
            )
            yield Finding("quality", "found_outside", drift.unit, message, (drift.unit,), _numbers(drift))


def _leaving(audit: Audit) -> Iterator[Finding]:
    """Units that are expected to leave their tolerance or limit before they are due."""
    due_day = {
        f"{audit.all.device[row]} {audit.all.unit[row]}": float(day)
        for row, day in zip(audit.due.row, audit.due.day, strict=True)
    }
    for drift in _each(audit):
        due = due_day.get(f"{drift.device} {drift.unit}", np.inf)
        for what, bound, days in (
            ("tolerance", drift.tolerance, (drift.leaves, drift.soonest, drift.latest)),
            ("limit", drift.limit, drift.limit_day),
        ):
            if days[0] < due and days[0] > drift.day:
                text = unit_text(drift.parameter)
                message = (
                    f"{drift.unit}: {drift.parameter} moves {drift.slope:+.3g} {text} a year and leaves its {what} of "
                    f"{bound:g} {text} about {_date(days[0])} "
                    f"({_date(days[1])} to {_date(days[2])}), before it is due on {date_of(due)}; call it in"
                )
                yield Finding("quality", "leaves", drift.unit, message, (drift.unit,), _numbers(drift))


def _unlike_their_kind(audit: Audit) -> Iterator[Finding]:
    """Units whose slope none of their kind has: each by its plainest parameter."""
    count = sum(len(drifts) for drifts in audit.units.values())
    for drifts in audit.units.values():
        worst = max(drifts, key=lambda drift: abs(drift.odd), default=None)
        if worst is not None and abs(worst.odd) > outlier_limit(count) and worst.day >= audit.scope.since:
            text = unit_text(worst.parameter)
            when = f"leaves its tolerance of {worst.tolerance:g} {text} about {_date(worst.leaves)}"
            message = (
                f"{worst.unit}: {worst.parameter} moves {worst.slope:+.3g} {text} a year over {worst.calibrations} calibrations, "
                f"{abs(worst.odd):.1f} σ from its kind, and {when} ({_date(worst.soonest)} to {_date(worst.latest)}): give it a "
                "shorter interval, or take it out of use"
            )
            yield Finding("quality", "drifts", worst.unit, message, (worst.unit,), _numbers(worst))


def _moved_stations(audit: Audit) -> Iterator[Finding]:
    """Changes of a station's level, each told once: by the effect in which it is plainest."""
    told: list[tuple[str, float]] = []
    found = [(abs(c.shift) / c.error, series, c) for series in audit.stations for c in series.changes]
    for _, series, change in sorted(found, key=lambda item: -item[0]):
        first = float(series.day[change.first])
        near = any(station == series.station and abs(day - first) < _reach(series, change) for station, day in told)
        told.append((series.station, first))
        if not near and first >= audit.scope.since:
            yield _moved(audit, series, change, "station_moved", f"{series.where} ({series.parameter})")


def _reach(series: Series, change: Change) -> float:
    """Days within which another change is the same event."""
    return 7.0 + float(series.day[min(change.high, series.day.size - 1)] - series.day[max(change.low - 1, 0)])


def _moved_slots(audit: Audit) -> Iterator[Finding]:
    for series in audit.slots:
        for change in series.changes:
            if float(series.day[change.first]) >= audit.scope.since:
                yield _moved(audit, series, change, "slot_moved", f"{series.where} ({series.parameter})")


def _moved(audit: Audit, series: Series, change: Change, kind: str, what: str) -> Finding:
    first, low = float(series.day[change.first]), float(series.day[max(change.low - 1, 0)])
    high = float(series.day[min(change.high, series.day.size - 1)])
    later = [c.first for c in series.changes if c.first > change.first]
    end = float(series.day[later[0]]) if later else np.inf
    units, runs = _measured(audit, series, low, end)
    until = f" until {date_of(end)}" if np.isfinite(end) else ""
    message = (
        f"{series.station}: {what} moved by {change.shift:+.0f} ± {2 * change.error:.0f} {series.unit_text} on "
        f"{date_of(first)} (between {date_of(low)} and {date_of(high)}, 95 %); {len(units)} units in {runs} runs were "
        f"measured there since{until}: level it and measure them again, or run them again with this effect in the model"
    )
    evidence = {
        "station": series.station, "where": series.where, "parameter": series.parameter, "date": date_of(first),
        "earliest": date_of(low), "latest": date_of(high), "shift_urad": change.shift, "standard_error_urad": change.error,
        "p_value": change.p_value, "first_run": str(series.run[change.first]), "units_since": len(units), "runs_since": runs,
    }  # fmt: skip
    return Finding("station", kind, series.station, message, units, evidence)


def _measured(audit: Audit, series: Series, start: float, end: float) -> tuple[tuple[str, ...], int]:
    """Units measured on a series' station, or in its slot, after the last moment that was surely good."""
    all_ = audit.all
    rows = (all_.station == series.station) & (all_.day > start) & (all_.day < end) & audit.product
    if series.where.startswith("slot "):
        rows &= all_.slot == int(series.where.removeprefix("slot "))
    return tuple(sorted({str(u) for u in all_.unit[rows]})), len({str(r) for r in all_.run[rows]})


def _standards(audit: Audit) -> Iterator[Finding]:
    for chart in audit.charts:
        if not chart.in_control:
            first = int(np.argmax(chart.rules.any(axis=0) | chart.outside))
            message = (
                f"{chart.station}: check standard {chart.standard}, {chart.parameter}: {chart.alarms} alarms on the control "
                f"chart since {date_of(chart.day[first])}, {chart.expected:.1f} are expected by chance "
                f"(p = {chart.p_value:.1g}); measure the standard on another station to see which of the two has moved"
            )
            evidence = {"station": chart.station, "standard": chart.standard, "parameter": chart.parameter,
                        "first": date_of(chart.day[first]), "alarms": chart.alarms, "expected": chart.expected,
                        "p_value": chart.p_value}  # fmt: skip
            yield Finding("station", "standard", chart.station, message, (chart.standard,), evidence)


def _gauges(audit: Audit) -> Iterator[Finding]:
    """Gauge studies that take too much of the tolerance, one finding a study."""
    most = audit.rules.gauge_most_percent
    bad = [s for s in audit.studies if np.isfinite(s.of_tolerance) and s.of_tolerance > most]
    for runs in dict.fromkeys(study.runs for study in bad):
        own = sorted((study for study in bad if study.runs == runs), key=lambda study: -study.of_tolerance)
        shares = ", ".join(f"{study.parameter} {study.of_tolerance:.0f} %" for study in own)
        message = (
            f"{own[0].device}: seating a unit again takes more of the tolerance than the {most:g} % allowed: {shares} "
            f"(study of {date_of(own[0].first_day)}, {len(runs)} runs); measure longer, or widen the tolerance"
        )
        evidence = {"runs": list(runs), "percent_of_tolerance": {study.parameter: study.of_tolerance for study in own}}
        yield Finding("station", "gauge", own[0].device, message, (), evidence)


def _overdue(audit: Audit) -> Iterator[Finding]:
    late = np.flatnonzero(audit.due.day < audit.scope.until)
    for device in np.unique(audit.all.device[audit.due.row[late]].astype(str)) if late.size else ():
        own = late[audit.all.device[audit.due.row[late]] == device]
        units = tuple(str(u) for u in audit.all.unit[audit.due.row[own]])
        oldest = date_of(float(audit.due.day[own].min()))
        message = f"{device}: {len(units)} units are overdue, the first since {oldest}; call them in ({_some(units)})"
        yield Finding("line", "overdue", str(device), message, units, {"oldest": oldest})


def _coming_due(audit: Audit) -> Iterator[Finding]:
    until = audit.scope.until
    soon = np.flatnonzero((audit.due.day >= until) & (audit.due.day < until + audit.rules.notice_days))
    for device in np.unique(audit.all.device[audit.due.row[soon]].astype(str)) if soon.size else ():
        own = soon[audit.all.device[audit.due.row[soon]] == device]
        units = tuple(str(u) for u in audit.all.unit[audit.due.row[own]])
        message = (
            f"{device}: {len(units)} units come due within {audit.rules.notice_days} days; plan them ({_some(units)})"
        )
        yield Finding("line", "due", str(device), message, units)


def _odd(audit: Audit) -> Iterator[Finding]:
    for odd in audit.odd:
        what = f"lot of run {odd.run} ({odd.units} units)" if odd.kind == "lot" else f"unit {odd.name}"
        text = unit_text(odd.parameter)
        message = (
            f"{odd.device}: {what} of {date_of(odd.day)} stands out in {odd.parameter}: {odd.value:.4g} {text}, "
            f"{odd.z:+.1f} σ from its kind; look for what was different in making it"
        )
        evidence = {"run": odd.run, "station": odd.station, "parameter": odd.parameter, "value": odd.value, "z": odd.z}
        yield Finding(
            "product", f"odd_{odd.kind}", odd.name, message, (odd.name,) if odd.kind == "unit" else (), evidence
        )


def _incapable(audit: Audit) -> Iterator[Finding]:
    for able in audit.abilities:
        if able.ppk.low < audit.rules.ppk_least:
            message = (
                f"{able.device}: {able.figure} has Ppk {able.ppk.value:.2f} ({able.ppk.low:.2f} to {able.ppk.high:.2f}) "
                f"against {able.limit:g} {able.unit_text}, at least {audit.rules.ppk_least:g} is needed; "
                f"{100 * able.outside.value:.2g} % are outside: narrow the spread, or widen the limit"
            )
            evidence = {
                "figure": able.figure,
                "ppk": able.ppk.value,
                "low": able.ppk.low,
                "high": able.ppk.high,
                "n": able.n,
            }
            yield Finding("product", "capability", able.device, message, (), evidence)


def _different(audit: Audit) -> Iterator[Finding]:
    for one in audit.differences:
        if one.by != "lot" and one.p < DIFFERENT_P and one.found.effect > TELLING_EFFECT:
            message = (
                f"{one.device}: {one.figure} differs between {one.by}s: {100 * one.found.effect:.0f} % of its variance, "
                f"p = {one.p:.1g} over {one.found.groups} {one.by}s; find out which, and why"
            )
            who = "station" if one.by in {"station", "slot"} else "product"
            evidence = {"figure": one.figure, "by": one.by, "share": one.found.effect, "p_value": one.p}
            yield Finding(who, f"differs_by_{one.by}", one.device, message, (), evidence)


def _each(audit: Audit) -> Iterator[UnitDrift]:
    for drifts in audit.units.values():
        yield from drifts


def _numbers(drift: UnitDrift) -> dict[str, Any]:
    return {
        "parameter": drift.parameter, "run": drift.run, "date": date_of(drift.day), "change": drift.change,
        "months": 12 * drift.years, "e_n": drift.e_n, "slope_per_year": drift.slope, "tolerance": drift.tolerance,
        "leaves": _date(drift.leaves), "soonest": _date(drift.soonest), "latest": _date(drift.latest),
    }  # fmt: skip


def _before(drift: UnitDrift) -> str:
    return date_of(drift.day - 365.25 * drift.years)


def _date(day: float) -> str:
    return date_of(day) if np.isfinite(day) else "never"


def _some(units: tuple[str, ...]) -> str:
    named = ", ".join(units[:MORE])
    return f"{named}, …" if len(units) > MORE else named
