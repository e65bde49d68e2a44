"""Start and stop of jobs, and the stream of their progress."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from pipelines.workbench.pages import RequestBody, page_address, workbench_of
from pipelines.workbench.services import lots, requests
from pipelines.workbench.services.jobs import Jobs
from schemas.errors import WrongUse

router = APIRouter()


EVERY_S = 0.15
HEARTBEAT = 60  # polls without news before a keep-alive message
STAMP_EVERY = 4


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
    content = stream(request, bench.boot, bench.jobs, lambda: {"lots": lots.stamp(bench.settings)})
    return StreamingResponse(content, media_type="text/event-stream", headers={"x-accel-buffering": "no"})


async def stream(request: Request, boot: str, jobs: Jobs, stamps: Callable[[], dict[str, str]]) -> AsyncIterator[str]:
    """The events, until the browser disconnects or the server ends.

    Parameters
    ----------
    boot : id of this process of the server
    stamps : of data that other processes change; the event states which changed
    """
    seen, known, quiet = jobs.version, await asyncio.to_thread(stamps), 0
    yield _event(
        "boot", {"boot": boot, "jobs": [job.document() for job in jobs.all() if job.state in {"waiting", "running"}]}
    )
    look = 0
    while not (request.app.state.ending() or await request.is_disconnected()):
        await asyncio.sleep(EVERY_S)
        look += 1
        version = jobs.version
        if version > seen:
            for job in jobs.all(seen):
                yield _event("job", job.document())
            seen, quiet = version, 0
        if look % STAMP_EVERY == 0:
            now = await asyncio.to_thread(stamps)
            for name in sorted(now):
                if now[name] != known.get(name):
                    yield _event("changed", {"what": name, "stamp": now[name]})
            known = now
        quiet += 1
        if quiet >= HEARTBEAT:
            quiet = 0
            yield ": still here\n\n"


def _event(name: str, content: dict[str, Any]) -> str:
    return f"event: {name}\ndata: {json.dumps(content, ensure_ascii=False)}\n\n"
