"""A file of the user: interpretation of its columns, correction, import, and coefficients."""

import math

from fastapi import APIRouter, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import JSONResponse, Response

from pipelines.importers.mapping import OUTPUT_UNITS, TEMPERATURE_UNITS, TIME_UNITS
from pipelines.report.numbers import with_uncertainty
from pipelines.workbench.pages import asked, page, table_csv, workbench_of
from pipelines.workbench.services import uploads
from pipelines.workbench.state import UploadPage
from schemas.errors import TumblelineError, WrongUse
from schemas.units import AXES

router = APIRouter()
HEADING, ORDER, ADDRESS = "Upload", 30, "/upload"


@router.get("/upload")
def upload(request: Request) -> Response:
    """The page: drop a file, check the interpretation of its columns, correct it, import it."""
    bench, state, problems = asked(request, UploadPage)
    reading, job, done = None, None, None
    if state.file:
        try:
            reading = uploads.reading(bench.settings, state)
            if state.columns and state.output and not reading.problem:
                done, job = bench.work("import", state, problems)
        except TumblelineError as problem:
            problems.append(str(problem))
    problems = [uploads.in_fields(text) for text in problems]
    dwells = () if reading is None else reading.dwells
    sizes = [abs(float(row[f"out_{axis}"])) for row in dwells for axis in AXES]
    sixth = 2e-5 * max(filter(math.isfinite, sizes), default=0.0)  # digit: values near zero have equally many decimals
    folder = bench.settings.folder / uploads.FOLDER
    files = [path for path in folder.iterdir() if not path.name.startswith(uploads.PART)] if folder.is_dir() else []
    there = sorted(files, key=lambda file: -file.stat().st_mtime)[:12]
    return page(
        request, "upload.html", state, problems, reading=reading, job=job, done=done, there=[str(file) for file in there],
        meanings=uploads.FIELDS, mapped=dict(pair.split("=", 1) for pair in state.columns if "=" in pair),
        in_fields=uploads.in_fields, level=lambda value: with_uncertainty(float(value), sixth)[0],
        outputs=list(OUTPUT_UNITS), times=[*TIME_UNITS, "samples"], temperatures=TEMPERATURE_UNITS,
    )  # fmt: skip


@router.put("/upload/file")
async def dropped(request: Request, name: str) -> JSONResponse:
    """Store a file; return the address of its page."""
    settings, size = workbench_of(request).settings, 0
    arrived = await run_in_threadpool(uploads.part_of, settings)
    try:
        with arrived.open("wb") as file:
            async for part in request.stream():
                size += len(part)
                if size > uploads.LARGEST:
                    raise WrongUse(
                        f"upload: more than {uploads.LARGEST // 10**6} MB; import it with 'tumbleline import {name[:80]}'"
                    )
                await run_in_threadpool(file.write, part)
        if not size:
            raise WrongUse(f"upload: '{name[:80]}' is empty; choose another file")
        path = await run_in_threadpool(uploads.keep, settings, name, arrived)
    finally:
        arrived.unlink(missing_ok=True)
    return JSONResponse({"address": UploadPage(file=path).address()})


@router.get("/upload/coefficients.csv")
def coefficients(request: Request) -> Response:
    """The coefficients of an import."""
    bench, state, _ = asked(request, UploadPage)
    done = bench.done("import", state)
    if done is None:
        raise WrongUse("upload: this file is not imported yet; import it first")
    return table_csv(done["coefficients"], "coefficients")
