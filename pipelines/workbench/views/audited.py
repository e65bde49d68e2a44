"""The audit of the archive for its page: the document of ``tumbleline audit`` and charts of the evidence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.workbench.views.audit_charts import control_chart, drift_chart, due_chart, series_chart, yield_chart
from pipelines.workbench.views.evidence import address_of, evidence
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pipelines.report.charts import Chart

MOST_CHARTS = 6
NAMES = ("since", "until", "device", "station")


def audited(request: Mapping[str, Any], tell: Callable[[int, int, str], None]) -> dict[str, Any]:
    """``document`` and ``charts`` of an audit."""
    from pipelines.archive import Archive
    from pipelines.audit.audit import audit
    from pipelines.audit.document import document, furthest
    from pipelines.audit.findings import findings
    from pipelines.audit.period import scope_of
    from pipelines.audit.rules import load_rules

    found = audit(Archive(request["archive"]), load_rules(None), scope_of(*(str(request[name]) for name in NAMES)))
    tell(1, 2, "the evidence of its findings")
    if not len(found.all) and not found.problems:
        raise WrongUse(
            f"audit: {request['archive']} has no calibration in this time, one at least is needed; make a run"
        )
    charts: dict[str, Chart] = {}
    months = [share for share in found.yields if share.of == "month"]
    if months:
        charts["yield"] = yield_chart(months)
    if found.due.row.size:
        charts["due"] = due_chart(found)
    for number, one in enumerate(sorted(found.charts, key=lambda one: one.p_value)[:MOST_CHARTS]):
        charts[f"control-{number}"] = control_chart(one)
    moved = sorted((*found.stations, *found.slots), key=lambda one: -len(one.changes))
    for number, one in enumerate(moved[:MOST_CHARTS]):
        charts[f"station-{number}"] = series_chart(one)
    for number, one in enumerate(furthest(found, MOST_CHARTS)):
        charts[f"drift-{number}"] = drift_chart(found, one)
    listed = findings(found)
    return {
        "document": document(found, listed, request["archive"]),
        "charts": charts,
        "evidence": evidence(found, listed),
        "addresses": [address_of(one) for one in listed],
    }
