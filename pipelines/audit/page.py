"""The audit as one page that needs no network."""

from functools import partial
from typing import Any

from inertial.uncertainty.rounding import chance
from pipelines.audit import pictures as drawn
from pipelines.audit.audit import Audit
from pipelines.audit.calibrations import date_of
from pipelines.audit.document import counts, furthest
from pipelines.audit.finding import WHO, AuditFinding, date_or
from pipelines.audit.parameters import unit_text
from pipelines.audit.stations_over_time import StationSeries
from pipelines.audit.unit_drifts import UnitDrift
from pipelines.drawing import still, svg_text
from pipelines.report.numbers import THIN, significant
from pipelines.report.templates import template

MOST_SERIES, MOST_CHARTS, MOST_HISTORIES, MOST_ROWS, MOST_OF_KIND = 8, 4, 4, 25, 40


def render(audit: Audit, listed: list[AuditFinding], archive: str) -> str:
    """The page as one HTML text without other files."""
    months = [share for share in audit.yields if share.of == "month"]
    series, drifts = _telling_series(audit), _telling_drifts(audit)
    charts = sorted(audit.charts, key=lambda chart: (chart.p_value, chart.station, chart.parameter))[:MOST_CHARTS]
    return template("audit.html").render(
        archive=archive,
        since=date_of(audit.scope.since) if audit.scope.since > _BEGINNING else "",
        until=date_of(audit.scope.until - 1.0),
        scope=", ".join(part for part in (audit.scope.device, audit.scope.station) if part),
        counts=counts(audit),
        groups=_groups(listed),
        total=len(listed),
        passed=next((share for share in audit.yields if share.of == "all"), None),
        overdue=audit.overdue.size,
        valid=int(audit.due.valid.sum()),
        rules=audit.rules,
        series_svg="".join(still(svg_text(drawn.series_chart(course))) for course in series),
        charts_svg="".join(still(svg_text(drawn.control_chart(chart))) for chart in charts),
        chart_count=len(audit.charts),
        yield_svg=still(svg_text(drawn.yield_chart(months))) if len(months) > 1 else "",
        due_svg=still(svg_text(drawn.due_chart(audit))) if audit.due.row.size else "",
        drift_svg="".join(still(svg_text(drawn.drift_chart(audit, drift))) for drift in drifts),
        shares=[share for share in audit.yields if share.of in {"device", "station"}],
        kinds=audit.kinds,
        furthest=furthest(audit, MOST_ROWS),
        abilities=audit.abilities,
        differences=[difference for difference in audit.differences if difference.p < 0.05],
        compared=len(audit.differences),
        studies=audit.studies,
        slots=audit.slot_means,
        odd=audit.odd[:MOST_ROWS],
        unit_text=unit_text,
        number=significant,
        signed=_signed,
        chance=chance,
        date=partial(date_or, never="–"),
        percent=lambda share: f"{significant(100.0 * share)} %",
        whole=lambda count: f"{count:,}".replace(",", THIN),
    )


SAME_EVENT_D = 14.0
_BEGINNING = -700000.0  # days before any calibration


def _groups(listed: list[AuditFinding]) -> list[dict[str, Any]]:
    """Findings by role; the first of each kind are shown, the others counted."""
    out: list[dict[str, Any]] = []
    for who, role in WHO.items():
        of_role = [finding for finding in listed if finding.who == who]
        shown: list[AuditFinding] = []
        more: dict[str, int] = {}
        for finding in of_role:
            if sum(earlier.kind == finding.kind for earlier in shown) < MOST_OF_KIND:
                shown.append(finding)
            else:
                more[finding.kind] = more.get(finding.kind, 0) + 1
        if of_role:
            out.append({"who": role, "findings": shown, "more": more, "count": len(of_role)})
    return out


def _telling_series(audit: Audit) -> list[StationSeries]:
    """The series with a change of level, most significant first and each event once; without one the levels of the stations."""
    moved = [series for series in (*audit.stations, *audit.slots) if series.changes]
    events: list[tuple[str, bool, float]] = []
    telling: list[StationSeries] = []
    for series in sorted(moved, key=lambda s: -max(c.significance for c in s.changes)):
        plainest = max(series.changes, key=lambda c: c.significance)
        event = (series.station, series.where.startswith("slot"), float(series.day[plainest.first]))
        if not any(event[:2] == known[:2] and abs(event[2] - known[2]) < SAME_EVENT_D for known in events):
            events.append(event)
            telling.append(series)
    if telling:
        return telling[:MOST_SERIES]
    return [station for station in audit.stations if station.where == "level_error"][:MOST_SERIES]


def _telling_drifts(audit: Audit) -> list[UnitDrift]:
    """The histories that differ most from their kind."""
    worst = [max(drifts, key=lambda d: abs(d.odd)) for drifts in audit.units.values()]
    several = [drift for drift in worst if drift.calibrations > 2]
    return sorted(several, key=lambda d: (-abs(d.odd), d.unit))[:MOST_HISTORIES]


def _signed(value: float) -> str:
    text = significant(value)
    return text if text.startswith("−") or not text else f"+{text}"
