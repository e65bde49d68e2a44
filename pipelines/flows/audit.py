"""The flow ``audit_archive``: the audit on a schedule, its findings as artifacts that the orchestrator shows."""

import re
from pathlib import Path
from typing import Any

from prefect import flow, task
from prefect.artifacts import create_markdown_artifact, create_table_artifact
from prefect.cache_policies import NO_CACHE

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.archive.files import ELSEWHERE, json_bytes, publish
from pipelines.audit.audit import Audit, Scope, audit
from pipelines.audit.calibrations import date_of, day_of
from pipelines.audit.document import counts, document
from pipelines.audit.finding import WHO, AuditFinding
from pipelines.audit.findings import findings
from pipelines.audit.page import render
from pipelines.audit.rules import load_rules
from pipelines.certificates.days import today
from pipelines.flows.dask_cluster import on_dask
from pipelines.orchestrator.archive_address import archive_of
from pipelines.tables.json_values import json_value

KEY = "tumbleline-audit"
MOST_ROWS = 500  # rows of the table of findings; page and document have all findings


@task(task_run_name="audit until {until}", cache_policy=NO_CACHE, persist_result=False)
def look(archive: Archive, rules: Path | None, since: str, until: str, dask: str | None, workers: int) -> Audit:
    """The flow: audit of an archive up to the end of a day."""
    scope = Scope(day_of(since or "0001-01-01"), day_of(until) + 1.0, tomorrow=day_of(today()) + 1.0)
    return audit(archive, load_rules(rules), scope, distribute=on_dask(dask or "", workers), workers=workers)


@task(task_run_name="tell", cache_policy=NO_CACHE, persist_result=False)
def publish_audit(audit_result: Audit, listed: list[AuditFinding], root: str, folder: Path) -> Path:
    """Write page and document of an audit and make artifacts of the findings; return the path of the page."""
    day = date_of(audit_result.scope.until - 1.0)
    page = folder / f"audit-{day}.html"
    publish(page, render(audit_result, listed, root).encode(), "audit", ELSEWHERE)
    publish(page.with_suffix(".json"), json_bytes(json_value(document(audit_result, listed, root))), "audit", ELSEWHERE)
    create_table_artifact(key=KEY, table=_table(listed), description=f"{number_of(len(listed), 'finding')} until {day}")
    create_markdown_artifact(key=f"{KEY}-summary", markdown=_summary(audit_result, listed, page))
    return page


@flow(name="audit_archive", persist_result=False, log_prints=False)
def audit_archive(
    archive: str | None = None,
    rules: str | None = None,
    pages: str = "audits",
    since: str = "",
    until: str = "",
    dask: str | None = None,
    workers: int = 1,
) -> int:
    """Audit an archive; return the number of findings.

    archive : without credentials, see :func:`pipelines.orchestrator.archive_address.archive_of`
    pages : folder for the page and the document of every audit
    since, until : dates; everything up to today where empty
    dask, workers : where runs are read, see :func:`pipelines.flows.dask_cluster.on_dask`
    """
    store = archive_of(archive)
    audit_result = look(store, Path(rules) if rules else None, since, until or today(), dask, workers)
    listed = findings(audit_result)
    publish_audit(audit_result, listed, str(store.root), Path(pages))
    return len(listed)


def _table(listed: list[AuditFinding]) -> list[dict[str, Any]]:
    return [
        {"who": WHO[finding.who], "kind": finding.kind, "subject": finding.subject, "finding": finding.message}
        for finding in listed[:MOST_ROWS]
    ] or [{"who": "", "kind": "none", "subject": "", "finding": "no action is needed"}]


def _summary(audit_result: Audit, listed: list[AuditFinding], page: Path) -> str:
    number = counts(audit_result)
    lines = [
        f"# Audit until {date_of(audit_result.scope.until - 1.0)}",
        (
            f"{number_of(number['calibrations'], 'calibration')} of {number_of(number['units'], 'unit')} "
            f"in {number_of(number['runs'], 'run')}. Report: `{page.resolve()}`"
        ),
    ]
    for who, role in WHO.items():
        of_role = [finding for finding in listed if finding.who == who]
        if of_role:
            lines += ["", f"## {role}", *(f"- {_escaped(finding.message)}" for finding in of_role[:MOST_ROWS])]
    return "\n".join(lines if listed else [*lines, "", "No action is needed."])


def _escaped(text: str) -> str:
    return re.sub(r"([*_`<>\[\]|])", r"\\\1", text)
