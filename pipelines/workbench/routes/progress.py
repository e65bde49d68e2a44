"""Start and stop of jobs, and the stream of their progress."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from pipelines.workbench.pages import RequestBody, Workbench, page_address, workbench_of
from pipelines.workbench.services import lots, requests
from pipelines.workbench.services.events import stream
from schemas.errors import WrongUse

router = APIRouter()


@router.post("/jobs")
def start(request: Request, body: RequestBody) -> JSONResponse:
    """Start the work that a page needs: ``kind`` and the page's ``address``; the job that does it."""
    bench, kind = workbench_of(request), str(body.get("kind", ""))
    title, content = requests.of_address(bench.settings, kind, *page_address(body))
    return JSONResponse(bench.jobs.submit(kind, title, content).document(), 202)


@router.post("/jobs/{name}/stop")
def stop(request: Request, name: str) -> JSONResponse:
    """End a job."""
    job = workbench_of(request).jobs.stop(name)
    if job is None:
        raise WrongUse(f"jobs: none is called '{name[:40]}'; it may belong to an earlier server process")
    return JSONResponse(job.document())


@router.get("/jobs/{name}")
def look(request: Request, name: str) -> JSONResponse:
    """Progress of a job."""
    job = workbench_of(request).jobs.get(name)
    if job is None:
        raise WrongUse(f"jobs: none is called '{name[:40]}'")
    return JSONResponse(job.document())


@router.get("/events")
async def events(request: Request) -> Response:
    """The stream of events."""
    bench = workbench_of(request)
    content = stream(request, bench.boot, bench.jobs, lambda: _stamps(bench))
    return StreamingResponse(content, media_type="text/event-stream", headers={"x-accel-buffering": "no"})


def _stamps(bench: Workbench) -> dict[str, str]:
    return {"lots": lots.stamp(bench.settings)}
