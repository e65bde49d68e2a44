"""What the lots of the archive show together: discoveries with their levels, evidence by effect and driver, reach."""

from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.workbench.pages import asked, figure, no_figure, page, table_csv
from pipelines.workbench.state import DiscoverPage
from schemas.errors import WrongUse

router = APIRouter()
HEADING, ORDER, ADDRESS = "Discover", 75, "/discover"


@router.get("/discover")
def discover(request: Request) -> Response:
    """The page."""
    bench, state, problems = asked(request, DiscoverPage)
    found, job = bench.work("discover", state, problems)
    return page(request, "discover.html", state, problems, empty=not bench.archive.run_ids(), found=found, job=job)


@router.get("/discover/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench, state, _ = asked(request, DiscoverPage)
    chart = bench.finished("discover", state)["charts"].get(name)
    if chart is None:
        raise no_figure(name)
    return figure(chart, ending, f"discover-{name}")


@router.get("/discover/levels-{name}.csv")
def levels(request: Request, name: str) -> Response:
    """The levels of a discovery."""
    bench, state, _ = asked(request, DiscoverPage)
    rows = [row for row in bench.finished("discover", state)["document"]["discoveries"] if row["id"] == name]
    if not rows:
        raise WrongUse(f"discover: no discovery is called '{name[:40]}'")
    return table_csv(rows[0]["levels"], f"levels-{name}")
