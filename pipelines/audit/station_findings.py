"""Findings about stations: changes of level and slots, check standards out of control, gauge studies above the limit."""

from collections.abc import Iterator

import numpy as np

from inertial.counts import number_of
from inertial.population.change_points import ChangePoint
from inertial.uncertainty.rounding import equal
from pipelines.audit.audit import Audit
from pipelines.audit.calibrations import date_of
from pipelines.audit.finding import AuditFinding
from pipelines.audit.parameters import parameter_text
from pipelines.audit.stations_over_time import StationSeries


def of_stations(audit: Audit) -> Iterator[AuditFinding]:
    """All findings about stations, the most serious kind first."""
    yield from _moved_stations(audit)
    for series in audit.slots:
        for change in series.changes:
            if float(series.day[change.first]) >= audit.scope.since:
                yield _moved(audit, series, change, "slot_moved")
    yield from _standards(audit)
    yield from _gauges(audit)


def _moved_stations(audit: Audit) -> Iterator[AuditFinding]:
    """Changes of a station's level, each reported once, by its most significant effect."""
    reported: list[tuple[str, float]] = []
    changes = [(c.significance, series, c) for series in audit.stations for c in series.changes]
    for _, series, change in sorted(changes, key=lambda item: -item[0]):
        first = float(series.day[change.first])
        days = series.day[min(change.high, series.day.size - 1)] - series.day[max(change.low - 1, 0)]
        near = any(station == series.station and abs(day - first) < 7.0 + days for station, day in reported)
        reported.append((series.station, first))
        if not near and first >= audit.scope.since:
            yield _moved(audit, series, change, "station_moved")


def _moved(audit: Audit, series: StationSeries, change: ChangePoint, kind: str) -> AuditFinding:
    first, low = float(series.day[change.first]), float(series.day[max(change.low - 1, 0)])
    high = float(series.day[min(change.high, series.day.size - 1)])
    later = [c.first for c in series.changes if c.first > change.first]
    end = float(series.day[later[0]]) if later else np.inf
    units, runs = _measured(audit, series, low, end)
    remedy = (
        "check its fixture; rotations of units measured there are wrong by this amount"
        if kind == "slot_moved"
        else "level it and measure them again, or re-analyse the runs with this effect in the model"
    )
    until = f" until {date_of(end)}" if np.isfinite(end) else ""
    message = (
        f"{series.station}: {series.where} ({parameter_text(series.parameter)}) moved by {change.shift:+.0f} "
        f"± {2 * change.error:.0f} "
        f"{series.unit_text} on {date_of(first)} (between {date_of(low)} and {date_of(high)}, 95 %); "
        f"{number_of(len(units), 'unit')} in {number_of(runs, 'run')} measured there since{until}: {remedy}"
    )
    evidence = {
        "station": series.station, "where": series.where, "parameter": series.parameter, "date": date_of(first),
        "earliest": date_of(low), "latest": date_of(high), "shift_urad": change.shift, "standard_error_urad": change.error,
        "p_value": change.p_value, "first_run": str(series.run[change.first]), "units_since": len(units), "runs_since": runs,
    }  # fmt: skip
    return AuditFinding("station", kind, series.station, message, units, evidence)


def _measured(audit: Audit, series: StationSeries, start: float, end: float) -> tuple[tuple[str, ...], int]:
    """Units measured on a series' station, or in its slot, after the last measurement before the change."""
    calibrations = audit.all
    rows = (
        (calibrations.station == series.station) & (calibrations.day > start) & (calibrations.day < end) & audit.product
    )
    if series.where.startswith("slot "):
        rows &= calibrations.slot == int(series.where.removeprefix("slot "))
    return tuple(sorted({str(u) for u in calibrations.unit[rows]})), len({str(r) for r in calibrations.run[rows]})


def _standards(audit: Audit) -> Iterator[AuditFinding]:
    for chart in audit.charts:
        if not chart.in_control:
            first = int(np.argmax(chart.hit))
            message = (
                f"{chart.station}: check standard {chart.standard}, {parameter_text(chart.parameter)}: "
                f"{number_of(chart.alarms, 'alarm')} on the control chart "
                f"since {date_of(chart.day[first])}, {chart.expected:.1f} expected by chance "
                f"(p {equal(chart.p_value)}); measure the standard on another station to find which of the two has changed"
            )
            evidence = {"station": chart.station, "standard": chart.standard, "parameter": chart.parameter,
                        "first": date_of(chart.day[first]), "alarms": chart.alarms, "expected": chart.expected,
                        "p_value": chart.p_value}  # fmt: skip
            yield AuditFinding("station", "standard", chart.station, message, (chart.standard,), evidence)


def _gauges(audit: Audit) -> Iterator[AuditFinding]:
    """Gauge studies with too large a share of the tolerance, one finding for each study."""
    most = audit.rules.gauge_most_percent
    bad = [s for s in audit.studies if np.isfinite(s.of_tolerance) and s.of_tolerance > most]
    for runs in dict.fromkeys(study.runs for study in bad):
        studies = sorted((study for study in bad if study.runs == runs), key=lambda study: -study.of_tolerance)
        shares = ", ".join(f"{parameter_text(study.parameter)} {study.of_tolerance:.0f} %" for study in studies)
        message = (
            f"{studies[0].device}: repeated seating takes more than the allowed {most:g} % of the tolerance: {shares} "
            f"(study of {date_of(studies[0].first_day)}, {number_of(len(runs), 'run')}); measure longer, or widen the tolerance"
        )
        evidence = {
            "runs": list(runs),
            "percent_of_tolerance": {study.parameter: study.of_tolerance for study in studies},
        }
        yield AuditFinding("station", "gauge", studies[0].device, message, (), evidence)
