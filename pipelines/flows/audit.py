"""The flow ``audit_archive``: the audit on a schedule, its findings as artifacts that the orchestrator shows."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from prefect import flow, task
from prefect.artifacts import create_markdown_artifact, create_table_artifact
from prefect.cache_policies import NO_CACHE

from pipelines.archive.files import ELSEWHERE, json_bytes, publish
from pipelines.audit.audit import Scope, audit
from pipelines.audit.calibrations import date_of, day_of
from pipelines.audit.document import counts, document
from pipelines.audit.finding import WHO
from pipelines.audit.findings import findings
from pipelines.audit.page import render
from pipelines.audit.rules import load_rules
from pipelines.certificates.days import today
from pipelines.flows.places import archive_of
from pipelines.flows.spread import on_dask
from pipelines.tables.json_values import json_value

if TYPE_CHECKING:
    from pipelines.archive import Archive
    from pipelines.audit.audit import Audit
    from pipelines.audit.finding import AuditFinding

KEY = "tumbleline-audit"
MOST_ROWS = 500  # of the table of findings; the page and the document have all


@task(task_run_name="audit until {until}", cache_policy=NO_CACHE, persist_result=False)
def look(archive: Archive, rules: Path | None, since: str, until: str, dask: str | None, workers: int) -> Audit:
    """What the archive tells, up to the end of a day."""
    scope = Scope(day_of(since or "0001-01-01"), day_of(until) + 1.0, tomorrow=day_of(today()) + 1.0)
    return audit(archive, load_rules(rules), scope, spread=on_dask(dask or "", workers), workers=workers)


@task(task_run_name="tell", cache_policy=NO_CACHE, persist_result=False)
def tell(found: Audit, told: list[AuditFinding], root: str, folder: Path) -> Path:
    """The page that was written, with the document beside it; the findings are artifacts as well."""
    day = date_of(found.scope.until - 1.0)
    page = folder / f"audit-{day}.html"
    publish(page, render(found, told, root).encode(), "audit", ELSEWHERE)
    publish(page.with_suffix(".json"), json_bytes(json_value(document(found, told, root))), "audit", ELSEWHERE)
    create_table_artifact(key=KEY, table=_table(told), description=f"{len(told)} findings until {day}")
    create_markdown_artifact(key=f"{KEY}-summary", markdown=_summary(found, told, page))
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
    """Audit an archive; how many findings there are.

    Parameters
    ----------
    archive : without credentials, see :func:`pipelines.flows.places.archive_of`
    pages : folder for the page and the document of every audit
    since, until : dates; everything up to today where empty
    dask, workers : where runs are read, see :func:`pipelines.flows.spread.on_dask`
    """
    store = archive_of(archive)
    found = look(store, Path(rules) if rules else None, since, until or today(), dask, workers)
    told = findings(found)
    tell(found, told, str(store.root), Path(pages))
    return len(told)


def _table(told: list[AuditFinding]) -> list[dict[str, Any]]:
    return [
        {"who": WHO[finding.who], "kind": finding.kind, "subject": finding.subject, "finding": finding.message}
        for finding in told[:MOST_ROWS]
    ] or [{"who": "", "kind": "none", "subject": "", "finding": "nothing needs doing"}]


def _summary(found: Audit, told: list[AuditFinding], page: Path) -> str:
    number = counts(found)
    lines = [
        f"# Audit until {date_of(found.scope.until - 1.0)}",
        f"{number['calibrations']} calibrations of {number['units']} units in {number['runs']} runs. Report: `{page.resolve()}`",
    ]
    for who, words in WHO.items():
        own = [finding for finding in told if finding.who == who]
        if own:
            lines += ["", f"## {words}", *(f"- {_escaped(finding.message)}" for finding in own[:MOST_ROWS])]
    return "\n".join(lines if told else [*lines, "", "Nothing needs doing."])


def _escaped(text: str) -> str:
    """Text that Markdown does not read as anything else."""
    return re.sub(r"([*_`<>\[\]|])", r"\\\1", text)
