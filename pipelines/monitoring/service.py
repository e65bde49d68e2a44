"""The service: ``/metrics`` for Prometheus, ``/healthz`` for health checks, and alerts to a web hook."""

import threading
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from pipelines.monitoring.alerts import Poster, alerts_of
from pipelines.monitoring.exposition import text
from pipelines.monitoring.snapshot import Monitor
from pipelines.orchestrator.worker_health import in_thread
from schemas.log_lines import tell

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
EVERY_S = 15.0
UNHEALTHY = 503


def application(monitor: Monitor) -> Starlette:
    """The application; its numbers contain no serial number, and no request changes anything."""

    def metrics(request: Request) -> Response:
        return Response(text(monitor.snapshot()), media_type=CONTENT_TYPE)

    def health(request: Request) -> Response:
        document = monitor.snapshot().document()
        return JSONResponse(dict(document), 200 if document["ok"] else UNHEALTHY)

    def live(request: Request) -> Response:
        return PlainTextResponse("alive\n")

    return Starlette(routes=[Route("/metrics", metrics), Route("/healthz", health), Route("/livez", live)])


@contextmanager
def alerting(monitor: Monitor, poster: Poster, audits: Path | None, every_s: float = EVERY_S) -> Generator[None]:
    """A context in which alerts are posted every ``every_s`` seconds, in a thread of this process."""

    def repeat(ended: threading.Event) -> None:
        before = ""
        while True:
            try:
                count, fault = poster.post(alerts_of(monitor.snapshot(), audits))
            except Exception as problem:  # noqa: BLE001 - the thread must not end without a word: the alerts are posted again
                count, fault = 0, f"alerts: {type(problem).__name__}: {problem}"
            if count:
                tell(f"alerts: {count} posted", event="alerts_posted", count=count)
            if fault and fault != before:
                tell(fault, level="error", event="alerts_failed")
            before = fault
            if ended.wait(every_s):
                return

    with in_thread("alerts", repeat, EVERY_S):
        yield
