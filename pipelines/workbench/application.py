"""The application: discovered pages, errors as sentences, static files, and access control."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from importlib import import_module
from pkgutil import iter_modules

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from inertial.errors import InertialError
from pipelines.workbench.pages import Workbench, page
from pipelines.workbench.security import Guard
from pipelines.workbench.services import lots
from pipelines.workbench.services.jobs import Jobs
from pipelines.workbench.services.lots import Stale
from pipelines.workbench.services.uploads import in_fields
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import PageState
from schemas.errors import TumblelineError
from schemas.installed import not_installed

ROUTES = "pipelines.workbench.routes"


LARGEST = 1_000_000
STREAMED = "/upload/file"
"""Goes to the disk as it arrives, with a limit of its own."""
CHANGING = frozenset({"POST", "PUT", "PATCH", "DELETE"})


def create_app(settings: WorkbenchSettings, ending: Callable[[], bool] = lambda: False) -> ASGIApp:
    """The application, with access control; streams of events end once the server is ``ending``."""
    settings.refuse_unsafe()
    bench = Workbench(settings, Jobs(settings.folder / "jobs.json", settings.workers))

    @asynccontextmanager
    async def life(app: FastAPI) -> AsyncGenerator[None]:
        yield
        bench.jobs.close()
        if settings.pause_lots:
            await asyncio.to_thread(lots.pause_all, settings)

    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, lifespan=life)
    app.state.workbench, app.state.ending = bench, ending
    pages: list[tuple[int, str, str]] = []
    for info in iter_modules(import_module(ROUTES).__path__):
        module = import_module(f"{ROUTES}.{info.name}")
        app.include_router(module.router)
        if hasattr(module, "HEADING"):
            pages.append((module.ORDER, module.HEADING, module.ADDRESS))
    bench.navigation = [(heading, address) for _, heading, address in sorted(pages)]
    app.add_api_route("/", lambda: RedirectResponse("/units", 303), include_in_schema=False)
    app.add_exception_handler(TumblelineError, _problem)
    app.add_exception_handler(InertialError, _problem)
    app.add_exception_handler(HTTPException, _not_there)
    app.add_exception_handler(RequestValidationError, _not_readable)
    app.add_exception_handler(Exception, _defect)
    return Guard(SmallBodies(app), settings)


def _problem(request: Request, problem: Exception) -> Response:
    text = in_fields(str(problem), request.url.path.rpartition("/")[2])
    return _answer(request, text, 409 if isinstance(problem, Stale) else 422)


def _not_there(request: Request, problem: Exception) -> Response:
    status = problem.status_code if isinstance(problem, HTTPException) else 404
    return _answer(request, f"{request.url.path[:80]}: there is no such page; choose one above", status)


def _not_readable(request: Request, problem: Exception) -> Response:
    return _answer(
        request, "request: its body or a parameter cannot be read, a JSON object is needed; reload the page", 422
    )


def _defect(request: Request, problem: Exception) -> Response:
    text = f"a defect of the program: {type(problem).__name__}: {problem}; the server's log has the details"
    return _answer(request, not_installed(problem) or text, 500)


def _answer(request: Request, text: str, status: int) -> Response:
    if "text/html" in request.headers.get("accept", "") and request.method == "GET":
        return page(request, "problem.html", PageState(), status=status, text=text)
    return JSONResponse({"problem": text}, status)


class SmallBodies:
    """Passes on requests whose body is of at most :data:`LARGEST` bytes."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on with its whole body, or answer 413."""
        if scope["type"] != "http" or scope["method"] not in CHANGING or scope["path"] == STREAMED:
            await self._app(scope, receive, send)
            return
        body, more = bytearray(), True
        while more:
            message = await receive()
            if message["type"] != "http.request":  # the client has gone
                return
            body += message.get("body", b"")
            more = message.get("more_body", False)
            if len(body) > LARGEST:
                text = f"{scope['path'][:80]}: more than {LARGEST} bytes, at most these are taken; send less"
                await JSONResponse({"problem": text}, 413, {"connection": "close"})(scope, receive, send)
                return
        sent = False

        async def given() -> Message:
            nonlocal sent
            if sent:
                return await receive()
            sent = True
            return {"type": "http.request", "body": bytes(body), "more_body": False}

        await self._app(scope, given, send)
