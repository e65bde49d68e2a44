"""The audit: findings with their evidence, calibrations due, charts of stations and drifts."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fastapi import APIRouter, Request
from starlette.exceptions import HTTPException
from starlette.responses import Response

from inertial.uncertainty.rounding import chance
from pipelines.audit.documents import AuditDocument
from pipelines.audit.finding import WHO
from pipelines.stages.figures import figure_label
from pipelines.workbench.pages import asked, figure, no_figure, page, table_csv
from pipelines.workbench.state import AuditPage

router = APIRouter()
HEADING, ORDER, ADDRESS = "Audit", 70, "/audit"
DUE, FINDINGS = 60, 40
COMPARED = ("station", "slot")
TABLES: dict[str, Callable[[AuditDocument], Sequence[Mapping[str, Any]]]] = {
    "due": lambda audited: [*audited["due"]["overdue"], *audited["due"]["soon"]],
    "capability": lambda audited: audited["population"]["capability"],
    "yield": lambda audited: audited["population"]["yield"],
    "differences": lambda audited: sorted(
        (row for row in audited["population"]["differences"] if row["by"] in COMPARED), key=lambda row: row["p"]
    ),
    "findings": lambda audited: [
        {key: row[key] for key in ("who", "kind", "subject", "message")} for row in audited["findings"]
    ],
}
"""Tables of the page that are saved as comma-separated values."""


@router.get("/audit")
def audit(request: Request) -> Response:
    """The page."""
    bench, state, problems = asked(request, AuditPage)
    audited, job = bench.work("audit", state, problems)
    return page(
        request, "audit.html", state, problems, empty=not bench.archive.run_ids(), audited=audited, job=job, who=WHO,
        most_due=DUE, most_findings=FINDINGS, compared=COMPARED, chance=chance,
        figure_label=figure_label,
    )  # fmt: skip


@router.get("/audit/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench, state, _ = asked(request, AuditPage)
    audited = bench.finished("audit", state)
    chart = audited["evidence"].get(state.finding) if name == "evidence" else audited["charts"].get(name)
    if chart is None:
        raise no_figure(name)
    return figure(chart, ending, f"audit-{name}")


@router.get("/audit/{name}.csv")
def table(request: Request, name: str) -> Response:
    """A table of the page."""
    if name not in TABLES:
        raise HTTPException(404)
    bench, state, _ = asked(request, AuditPage)
    return table_csv([_flat(row) for row in TABLES[name](bench.finished("audit", state)["document"])], name)


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """Value and ends of an interval in separate columns; empty for an interval that is not known."""
    out: dict[str, Any] = {}
    for key, value in row.items():
        if value is not None:
            out |= {f"{key}_{side}": value[side] for side in value} if isinstance(value, dict) else {key: value}
    return out
