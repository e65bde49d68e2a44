"""The audit as one JSON document."""

from dataclasses import asdict
from typing import Any

import numpy as np

from inertial.arrays import Index
from inertial.population.control_charts import RULES
from pipelines.audit.audit import Audit
from pipelines.audit.calibrations import date_of
from pipelines.audit.documents import AuditDocument, AuditFindingDocument, DueDocument, DueUnit
from pipelines.audit.due import uncertified
from pipelines.audit.finding import WHO, AuditFinding, date_or
from pipelines.audit.parameters import unit_text
from pipelines.audit.stations_over_time import ControlChart, StationSeries
from pipelines.audit.unit_drifts import UnitDrift

MOST_UNITS = 200  # histories in the document; ``tumbleline archive query`` gives the others by their serial
SCHEMA = 1


def document(audit: Audit, listed: list[AuditFinding], archive: str) -> AuditDocument:
    """The results of the audit, findings first; dates are ISO and UTC."""
    return {
        "schema": SCHEMA,
        "archive": archive,
        "since": date_of(audit.scope.since),
        "until": date_of(audit.scope.until),
        "device": audit.scope.device,
        "station": audit.scope.station,
        "counts": counts(audit),
        "findings": [_finding(finding) for finding in listed],
        "due": _due(audit),
        "drift": {"kinds": _kinds(audit), "units": [_unit(d) for d in furthest(audit, MOST_UNITS)]},
        "stations": [_series(series) for series in (*audit.stations, *audit.slots)],
        "slots": list(audit.slot_means),
        "charts": [_chart(chart) for chart in audit.charts],
        "population": {
            "yield": [asdict(share) for share in audit.yields],
            "capability": [asdict(able) for able in audit.abilities],
            "differences": [asdict(difference) for difference in audit.differences],
            "odd": [{**asdict(odd), "date": date_of(odd.day)} for odd in audit.odd],
        },
        "gauge": [_study(study) for study in audit.studies],
        "rules": audit.rules.model_dump(mode="json"),
    }


def _finding(finding: AuditFinding) -> AuditFindingDocument:
    return {
        "who": finding.who, "kind": finding.kind, "subject": finding.subject, "message": finding.message,
        "units": list(finding.units), "evidence": finding.evidence, "whose": WHO[finding.who],
    }  # fmt: skip


def counts(audit: Audit) -> dict[str, int]:
    """Numbers of audited runs, units and calibrations."""
    calibrations = audit.all
    return {
        "calibrations": len(calibrations),
        "in_period": int(audit.period.sum()),
        "units": int(calibrations.histories[-1]) + 1 if len(calibrations) else 0,
        "runs": int(np.unique(calibrations.run.astype(str)).size),
        "stations": int(np.unique(calibrations.station.astype(str)).size),
        "unreadable_runs": len(audit.problems),
        "certificates": len(audit.certificates),
    }


def furthest(audit: Audit, most: int) -> list[UnitDrift]:
    """Parameters of units whose last change was in the period, the largest |E_n| first; each unit once."""
    worst = [max(drifts, key=lambda d: abs(d.e_n) if np.isfinite(d.e_n) else 0.0) for drifts in audit.units.values()]
    recent = [drift for drift in worst if drift.day >= audit.scope.since]
    return sorted(recent, key=lambda d: (-np.nan_to_num(abs(d.e_n)), d.unit))[:most]


def _due(audit: Audit) -> DueDocument:
    due_units = audit.due

    def listed(which: Index) -> list[DueUnit]:
        return [
            {
                "unit": str(audit.all.unit[row]), "device": str(audit.all.device[row]),
                "last": date_of(float(audit.all.day[row])), "due": date_of(float(due_units.day[k])),
                "run": str(audit.all.run[row]), "months": float(due_units.months[k]), "because": str(due_units.because[k]),
                "certificate": str(due_units.certificate[k]), "valid": bool(due_units.valid[k]),
            }
            for k, row in zip(which, due_units.row[which], strict=True)
        ]  # fmt: skip

    return {
        "interval": audit.rules.interval,
        "units": due_units.row.size,
        "valid": int(due_units.valid.sum()),
        "overdue": listed(audit.overdue),
        "soon": listed(audit.coming_due),
        "uncertified": listed(uncertified(audit.all, due_units, audit.certificates)),
    }


def _kinds(audit: Audit) -> list[dict[str, Any]]:
    return [
        {
            "device": kind.device, "parameter": kind.parameter, "unit_text": unit_text(kind.parameter), "pairs": kind.kind.pairs,
            "slope_mean_per_year": kind.kind.mean_slope, "slope_sd_per_year": kind.kind.slope_sd,
            "walk_sd_per_root_year": kind.kind.walk_sd, "seating_sd": kind.kind.mount_sd, "median_change": kind.median,
            "share_beyond_uncertainty": kind.beyond, "share_beyond_tolerance": kind.out,
            "tolerance": kind.tolerance, "reliable_months": kind.reliable_months,
        }
        for kind in audit.kinds
    ]  # fmt: skip


def _unit(drift: UnitDrift) -> dict[str, Any]:
    days = ("leaves", "soonest", "latest", "reliable_day")
    plain = {k: v for k, v in asdict(drift).items() if k not in {*days, "day", "limit_day"}}
    dates = {name.removesuffix("_day"): date_or(getattr(drift, name), None) for name in days}
    about = {"unit_text": unit_text(drift.parameter), "date": date_of(drift.day)}
    return {**plain, **about, **dates, "leaves_limit": [date_or(day, None) for day in drift.limit_day]}


def _series(series: StationSeries) -> dict[str, Any]:
    return {
        **{name: getattr(series, name) for name in ("station", "where", "parameter", "unit_text")},
        "n": int(series.value.size),
        "mean": float(np.mean(series.value)),
        "noise": series.noise,
        "weeks": weekly(series),
        "changes": [
            {
                "date": date_of(series.day[c.first]),
                "earliest": date_of(series.day[max(c.low - 1, 0)]),
                "latest": date_of(series.day[min(c.high, series.day.size - 1)]),
                "first_run": str(series.run[c.first]),
                "shift": c.shift,
                "standard_error": c.error,
                "p_value": c.p_value,
            }
            for c in series.changes
        ],
    }


def weekly(series: StationSeries) -> list[dict[str, Any]]:
    """Means of the weeks: their Monday, number of values, mean."""
    week = np.floor((series.day - 4.0) / 7.0).astype(int)  # 1970-01-05 was a Monday
    numbers, index = np.unique(week, return_inverse=True)
    n = np.bincount(index)
    mean = np.bincount(index, series.value) / n
    return [
        {"week": date_of(7.0 * w + 4.0), "n": int(c), "mean": float(m)}
        for w, c, m in zip(numbers, n, mean, strict=True)
    ]


def _chart(chart: ControlChart) -> dict[str, Any]:
    return {
        **{name: getattr(chart, name) for name in ("station", "standard", "parameter", "unit_text")},
        "n": int(chart.value.size),
        "centre": chart.chart.centre,
        "sigma": chart.chart.sigma,
        "alarms": chart.alarms,
        "expected_by_chance": chart.expected,
        "p_value": chart.p_value,
        "in_control": chart.in_control,
        "signals": [
            {
                "date": date_of(chart.day[k]),
                "run": str(chart.run[k]),
                "value": float(chart.value[k]),
                "rules": [RULES[r] for r in np.flatnonzero(chart.rules[:, k])],
                "ewma": bool(chart.outside[k]),
            }
            for k in np.flatnonzero(chart.hit)
        ],
    }


def _study(study: Any) -> dict[str, Any]:
    gauge = study.gauge
    return {
        "device": study.device, "parameter": study.parameter, "unit_text": unit_text(study.parameter),
        "stations": list(study.stations), "first": date_of(study.first_day), "last": date_of(study.last_day),
        "runs": list(study.runs), "percent_of_tolerance": study.of_tolerance, "percent_of_total": gauge.percent,
        "categories": gauge.categories, "gauge": gauge.gauge, **asdict(gauge),
    }  # fmt: skip
