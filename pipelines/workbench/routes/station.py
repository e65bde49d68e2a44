"""The station of a run: temperatures and angles over its time, pauses, and duration of soaks."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.report.run_pictures import station_chart
from pipelines.tables.frames import rows_of
from pipelines.workbench.pages import figure, page, run_table, state_of, workbench_of
from pipelines.workbench.state import StationPage
from schemas.errors import WrongUse

router = APIRouter()
HEADING, ORDER, ADDRESS = "Station", 60, "/station"
NEEDED = {"history", "readings", "events"}


@router.get("/station")
def station(request: Request) -> Response:
    """The page of a run's station."""
    bench = workbench_of(request)
    state, problems = state_of(request, StationPage)
    infos = bench.archive.runs()[::-1]
    run, events, soaks = None, [], []
    if infos:
        run = bench.archive.run(state.run)
        state = state.model_copy(update={"run": run.id})
        tables = set(run.tables())
        events = run.records.events.documents() if run.records is not None else []
        soaks = rows_of(run_table(bench, run.id, "soaks")) if "soaks" in tables else []
        if not tables >= NEEDED:
            problems = [
                *problems,
                f"run {run.id} was not measured on a station of this archive: it has no temperatures over time",
            ]
    return page(
        request, "station.html", state, problems, run=run, events=events[::-1], soaks=soaks, infos=infos[:50],
        drawable=run is not None and set(run.tables()) >= NEEDED,
    )  # fmt: skip


@router.get("/station/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench = workbench_of(request)
    state, _ = state_of(request, StationPage)
    if name != "station":
        raise WrongUse(f"figure: none of this page is called '{name[:40]}'")
    history, readings, events = (run_table(bench, state.run, table) for table in ("history", "readings", "events"))
    return figure(station_chart(history, readings, events), ending, f"{state.run}-station")
