"""The audit of the archive for its page: the document of ``tumbleline audit`` and charts of the evidence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pipelines.audit.finding import AuditFinding
from pipelines.audit.pictures import (
    control_chart,
    drift_chart,
    due_chart,
    evidence_chart,
    series_chart,
    yield_chart,
)
from pipelines.drawing import Chart
from schemas.errors import WrongUse

MOST_CHARTS = 6
MOST_EVIDENCE = 80  # findings with a chart of their own
NAMES = ("since", "until", "device", "station")


def audited(request: Mapping[str, Any], tell: Callable[[int, int, str], None]) -> dict[str, Any]:
    """``document`` and ``charts`` of an audit."""
    from pipelines.archive import Archive
    from pipelines.audit.audit import audit
    from pipelines.audit.document import document, furthest
    from pipelines.audit.findings import findings
    from pipelines.audit.period import scope_of
    from pipelines.audit.rules import load_rules

    archive_audit = audit(
        Archive(request["archive"]), load_rules(None), scope_of(*(str(request[name]) for name in NAMES))
    )
    tell(1, 2, "the evidence of its findings")
    if not len(archive_audit.all) and not archive_audit.problems:
        raise WrongUse(
            f"audit: {request['archive']} has no calibration in this time, one at least is needed; make a run"
        )
    charts: dict[str, Chart] = {}
    months = [share for share in archive_audit.yields if share.of == "month"]
    if months:
        charts["yield"] = yield_chart(months)
    if archive_audit.due.row.size:
        charts["due"] = due_chart(archive_audit)
    for number, one in enumerate(sorted(archive_audit.charts, key=lambda one: one.p_value)[:MOST_CHARTS]):
        charts[f"control-{number}"] = control_chart(one)
    moved = sorted((*archive_audit.stations, *archive_audit.slots), key=lambda one: -len(one.changes))
    for number, one in enumerate(moved[:MOST_CHARTS]):
        charts[f"station-{number}"] = series_chart(one)
    for number, one in enumerate(furthest(archive_audit, MOST_CHARTS)):
        charts[f"drift-{number}"] = drift_chart(archive_audit, one)
    listed = findings(archive_audit)
    evidence = {address_of(one): evidence_chart(archive_audit, one) for one in listed[:MOST_EVIDENCE]}
    return {
        "document": document(archive_audit, listed, request["archive"]),
        "charts": charts,
        "evidence": {name: chart for name, chart in evidence.items() if chart is not None},
        "addresses": [address_of(one) for one in listed],
    }


def address_of(finding: AuditFinding) -> str:
    """A name of a finding that stays the same as long as the finding does."""
    words = (finding.kind, finding.subject, str(finding.evidence.get("parameter", finding.evidence.get("figure", ""))))
    return ".".join(word for word in words if word)[:180]
