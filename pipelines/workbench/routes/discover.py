"""What the lots of the archive show together: discoveries with their levels, evidence by effect and driver, reach."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.workbench.pages import figure, page, state_of, table_csv, workbench_of
from pipelines.workbench.services import requests
from pipelines.workbench.state import DiscoverPage
from schemas.errors import TumblelineError, WrongUse

router = APIRouter()
HEADING, ORDER, ADDRESS = "Discover", 75, "/discover"


@router.get("/discover")
def discover(request: Request) -> Response:
    """The page."""
    bench = workbench_of(request)
    state, problems = state_of(request, DiscoverPage)
    found, job = None, None
    try:
        _, content = requests.discover(bench.settings, state)
        found, job = bench.jobs.result("discover", content), bench.jobs.known("discover", content)
    except TumblelineError as problem:
        problems = [*problems, str(problem)]
    return page(
        request, "discover.html", state, problems, empty=not bench.archive.run_ids(), found=found, job=job
    )  # fmt: skip


@router.get("/discover/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    chart = _finished(request)["charts"].get(name)
    if chart is None:
        raise WrongUse(f"figure: none of this page is called '{name[:40]}'")
    return figure(chart, ending, f"discover-{name}")


@router.get("/discover/levels-{name}.csv")
def levels(request: Request, name: str) -> Response:
    """The levels of a discovery."""
    rows = [row for row in _finished(request)["document"]["discoveries"] if row["id"] == name]
    if not rows:
        raise WrongUse(f"discover: no discovery is called '{name[:40]}'")
    return table_csv(rows[0]["levels"], f"levels-{name}")


def _finished(request: Request) -> dict[str, Any]:
    state, _ = state_of(request, DiscoverPage)
    bench = workbench_of(request)
    found: dict[str, Any] | None = bench.jobs.result("discover", requests.discover(bench.settings, state)[1])
    if found is None:
        raise WrongUse("discover: not finished; wait until it is done")
    return found
