"""The station of a run: temperatures and angles over its time, pauses, and duration of soaks."""

from pathlib import Path

import pandas as pd
from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.commissioning.frames import timeline
from pipelines.drawing import Chart, Plot, PlotAxis
from pipelines.report.run_pictures import station_chart
from pipelines.tables.frames import rows_of
from pipelines.workbench.pages import Workbench, asked, figure, no_figure, page, run_table
from pipelines.workbench.state import StationPage
from schemas.errors import WrongUse
from stations.recordings.frame_file import read_frames

router = APIRouter()
HEADING, ORDER, ADDRESS = "Station", 60, "/station"
NEEDED = {"history", "readings", "events"}
FOLDER = "recordings"
LARGEST = 64_000_000
"""Bytes of a recording that a page draws; 'tumbleline station frames' shows larger ones."""


def recordings_of(bench: Workbench) -> dict[str, Path]:
    """The recordings of links in the folder ``recordings`` of a local archive, by name, newest first."""
    root = bench.archive.root
    if not isinstance(root, Path):
        return {}
    found = [path for path in (root / FOLDER).glob("*.jsonl") if path.is_file() and path.stat().st_size <= LARGEST]
    return {path.name: path for path in sorted(found, key=lambda path: -path.stat().st_mtime)}


@router.get("/station")
def station(request: Request) -> Response:
    """The page of a run's station."""
    bench, state, problems = asked(request, StationPage)
    infos = bench.archive.runs()[::-1]
    run, events, soaks = None, [], []
    if infos:
        run = bench.archive.run(state.run)
        state = state.model_copy(update={"run": run.id})
        tables = set(run.tables())
        events = run.records.events.documents() if run.records is not None else []
        soaks = rows_of(run_table(bench, run.id, "soaks")) if "soaks" in tables else []
        if not tables >= NEEDED:
            problems.append(
                f"run {run.id} was not measured on a station of this archive: it has no temperatures over time"
            )
    recordings = recordings_of(bench)
    if state.recording and state.recording not in recordings:
        problems.append(f"recording: the archive has none called '{state.recording[:40]}'")
        state = state.model_copy(update={"recording": ""})
    return page(
        request, "station.html", state, problems, recordings=list(recordings), run=run,
        events=events[::-1], soaks=soaks, infos=infos[:50],
        drawable=run is not None and set(run.tables()) >= NEEDED,
    )  # fmt: skip


@router.get("/station/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench, state, _ = asked(request, StationPage)
    if name == "frames":
        path = recordings_of(bench).get(state.recording)
        if path is None:
            raise WrongUse(f"recording: the archive has none called '{state.recording[:40]}'; choose one of the page")
        return figure(timeline(read_frames(path)), ending, path.stem)
    if name != "station":
        raise no_figure(name)
    return figure(chart_of_run(bench, state.run), ending, f"{state.run}-station")


def nothing_yet() -> Chart:
    """The picture of a run before its first record."""
    axes = PlotAxis("station time / h"), PlotAxis("temperature / °C")
    return Chart("Temperatures and angles", (Plot("no record is finished yet", *axes, ()),), height=560)


def chart_of_run(bench: Workbench, run: str) -> Chart:
    """Temperatures and angles of a run, as far as it is measured; no lines before the first record."""
    stored = bench.archive.run(run)
    if set(stored.tables()) >= NEEDED:
        return station_chart(*(run_table(bench, run, table) for table in ("history", "readings", "events")))
    records = stored.records
    if records is None or not records.finished():
        return nothing_yet()
    events = pd.DataFrame(records.events.documents(), columns=["kind", "time_s", "reason"])
    return station_chart(records.gathered("history"), records.gathered("readings"), events)
