"""The flow ``discover_in_archive``: every night what the lots of an archive show together, with its discoveries as artifacts."""

from datetime import UTC, datetime
from pathlib import Path

from prefect import flow, task
from prefect.artifacts import create_markdown_artifact
from prefect.cache_policies import NO_CACHE

from inertial.counts import number_of
from pipelines.archive.files import ELSEWHERE, json_bytes, publish
from pipelines.discovery.discover import Look, discovered
from pipelines.discovery.documents import DiscoverDocument
from pipelines.discovery.page import render
from pipelines.discovery.sentences import texts_of
from pipelines.orchestrator.archive_address import archive_of
from pipelines.tables.json_values import json_value

KEY = "tumbleline-discoveries"


@task(task_run_name="discover", cache_policy=NO_CACHE, persist_result=False)
def look(archive: str | None, device: str, pages: Path, workers: int) -> DiscoverDocument:
    """Score what is new, judge the night, write page and document."""
    store = archive_of(archive)
    looked = discovered(store, Look(device=device, workers=workers))
    path = pages / f"discover-{datetime.now(UTC).date().isoformat()}"
    page = render(looked.found, looked.document, str(store.root))
    publish(path.with_suffix(".html"), page.encode(), "discover", ELSEWHERE)
    publish(path.with_suffix(".json"), json_bytes(json_value(looked.document)), "discover", ELSEWHERE)
    return looked.document


@flow(name="discover_in_archive", persist_result=False, log_prints=False)
def discover_in_archive(archive: str | None = None, device: str = "", pages: str = "audits", workers: int = 1) -> int:
    """Look for what many lots show together; return the number of new discoveries.

    archive : without credentials, see :func:`pipelines.orchestrator.archive_address.archive_of`
    pages : folder for the page and the document of every night
    """
    document = look(archive, device, Path(pages), workers)
    rows = [f"- {'. '.join(texts_of(row)[:2])}" for row in (*document["discoveries"], *document["unexplained"])]
    title = f"# {number_of(len(rows), 'discovery', 'discoveries')} in {number_of(document['pooled']['lots'], 'lot')}"
    create_markdown_artifact(key=KEY, markdown="\n".join([title, "", *(rows or ["Nothing is beyond chance."])]))
    return len(document["new"])
