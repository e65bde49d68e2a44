"""One stream of server-sent events: server process, progress of jobs, changes of lots and runs.

The first event states the id of
the server process; a page with another id reloads.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import TYPE_CHECKING, Any

from pipelines.workbench.services.jobs import Jobs

if TYPE_CHECKING:
    from starlette.requests import Request

EVERY_S = 0.15
HEARTBEAT = 60  # polls without news before a keep-alive message
STAMP_EVERY = 4


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
