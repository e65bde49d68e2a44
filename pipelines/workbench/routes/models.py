"""Models: the versions of a model file, its effect on the archive's lots, and its release to the line."""

from datetime import UTC, datetime
from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response

from inertial import effects
from pipelines.jobs.model_files import read_model, versions
from pipelines.jobs.releases import released, releases
from pipelines.workbench.pages import RequestBody, Workbench, asked, page, table_csv, workbench_of
from pipelines.workbench.services import models
from pipelines.workbench.state import ModelsPage
from schemas.errors import TumblelineError

router = APIRouter()
HEADING, ORDER, ADDRESS = "Models", 30, "/models"


@router.get("/models")
def shown(request: Request) -> Response:
    """The page; the what-if is computed on request."""
    bench, state, problems = asked(request, ModelsPage)
    what_if, job, steps = None, None, []
    if state.model:
        try:
            path = models.path_of(bench.settings, state.model)
            with effects.additions_forgotten():
                steps = versions(read_model(path))[::-1]
            what_if, job = bench.work("whatif", state, problems)
        except TumblelineError as problem:
            problems.append(str(problem))
    return page(
        request, "models.html", state, problems, models=models.models(bench.settings), steps=steps, whatif=what_if, job=job,
        releases=_releases(bench), today=datetime.now(UTC).date().isoformat(),
    )  # fmt: skip


@router.get("/models/lots.csv")
def lots(request: Request) -> Response:
    """The what-if by device and station."""
    bench, state, _ = asked(request, ModelsPage)
    what_if = bench.done("whatif", state)
    rows = [] if what_if is None else [*what_if["groups"], {"station": "all", "device": "all", **what_if["total"]}]
    return table_csv([_flat(row) for row in rows], f"what-if-{state.model}")


@router.post("/models/release")
def release(request: Request, body: RequestBody) -> JSONResponse:
    """Release a model to the line; refused without a what-if that says "better"."""
    words = {name: str(body.get(name, "")).strip() for name in ("name", "since", "device", "station", "reason")}
    record = models.release(workbench_of(request).settings, **words)
    name = f"{record.model.model_name} version {record.model.model_version}"
    return JSONResponse({"done": f"release {record.number}: {name} from {record.since:%Y-%m-%d}"})


def _releases(bench: Workbench) -> list[dict[str, Any]]:
    """The releases, the newest first, with whether each is in use today."""
    records, now = releases(bench.archive), datetime.now(UTC)
    return [
        {
            "record": record,
            "scope": f"{record.device} on {record.station}".removeprefix(" on ").removesuffix(" on ") or "all",
            "in_use": released(bench.archive, record.device, record.station, now) == record,
        }
        for record in records[::-1]
    ]


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """Old and new value of a figure in separate columns."""
    out: dict[str, Any] = {}
    for key, value in row.items():
        pair = isinstance(value, (list, tuple)) and len(value) == 2
        out |= {f"{key}_old": value[0], f"{key}_new": value[1]} if pair else {key: value}
    return out
