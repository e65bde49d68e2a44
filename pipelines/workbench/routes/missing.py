"""Missing effects: adequacy of the model, drivers of the residual, effects that explain it, the next measurement."""

from functools import partial

from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response

from pipelines.diagnosis.inputs import use_written_formulas
from pipelines.diagnosis.sections import worded
from pipelines.drawing import Chart
from pipelines.report.diagnosis_pictures import evolution_chart, pose_chart, quantity_chart, slot_chart
from pipelines.report.effect_view import effect_chart
from pipelines.report.residual_table import ResidualTable
from pipelines.report.run_pictures import samples_chart
from pipelines.workbench.pages import (
    RequestBody,
    Workbench,
    asked,
    figure,
    no_figure,
    not_known,
    page,
    page_part,
    part_of,
    samples_of,
    state_at,
    table_csv,
    workbench_of,
)
from pipelines.workbench.services import models, requests, sources
from pipelines.workbench.services.work import Diagnosed
from pipelines.workbench.state import MissingPage, TwoModelsPage
from schemas.errors import TumblelineError, WrongUse

router = APIRouter()
HEADING, ORDER, ADDRESS = "Missing effects", 20, "/missing"
CANDIDATES, INFLUENCE = 12, 12


@router.get("/missing")
def missing(request: Request) -> Response:
    """The page; the page itself requests missing results."""
    bench, state, problems = asked(request, MissingPage)
    if part_of(request) == "samples" and state.source and not problems:
        state = requests.settled(bench.settings, state)
        return page_part(request, "missing_samples.html", state, is_file=sources.is_file(bench.settings, state.source))
    chosen, diagnosed, rows, work = sources.sources(bench.settings), None, None, {}
    if state.source:
        try:
            state = requests.settled(bench.settings, state)
            work = {kind: requests.KINDS[kind][1](bench.settings, state) for kind in ("diagnose", "ladder")}
            diagnosed, rows = (bench.jobs.result(kind, content) for kind, (_, content) in work.items())
        except TumblelineError as problem:
            problems, work = [*problems, str(problem)], {}
    table = None if diagnosed is None else diagnosed.table
    problems += not_known(state, unit=table.units, against=table.drivers) if table is not None else []
    return page(
        request, "missing.html", state, problems, sources=chosen, diagnosed=diagnosed, rows=rows,
        worded=None if diagnosed is None else worded(diagnosed.document),
        jobs={kind: bench.jobs.known(kind, content) for kind, (_, content) in work.items()},
        twin=sources.twin(bench.settings, state.source) if state.source and not state.fresh else "",
        models=models.models(bench.settings),
        ladder_command=state.ladder_command(bench.settings.archive),
        unit=state.unit if table is None else table.units[table.index_of(state.unit)],
        against="" if diagnosed is None else _quantity(diagnosed, state), candidates=CANDIDATES, influence=INFLUENCE,
        two_models=TwoModelsPage(),
        drivers=[] if table is None else [(name, label) for name, (label, _) in table.drivers.items()],
        is_file=any(source.is_file and source.name == state.source for source in chosen),
    )  # fmt: skip


@router.get("/missing/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench, state, _ = asked(request, MissingPage)
    return figure(_chart(bench, state, name), ending, f"missing-{name}")


@router.get("/missing/candidates.csv")
def candidates(request: Request) -> Response:
    """The candidates of the first step."""
    bench, state, _ = asked(request, MissingPage)
    diagnosed = _diagnosed(bench, state)
    return table_csv([] if diagnosed is None else list(diagnosed.ladder), "candidates")


@router.post("/missing/save")
def save(request: Request, body: RequestBody) -> JSONResponse:
    """Save the model of a page's address as the next version of a model file."""
    bench = workbench_of(request)
    state = state_at(body, MissingPage)
    diagnosed = _diagnosed(bench, state)
    if diagnosed is None:
        raise WrongUse("model: the diagnosis of this model is not finished; wait until it is done, then save")
    added = list(state.added)
    start = [name for name in diagnosed.document["effects"] if name not in added]
    name, why = str(body.get("name", "")), str(body.get("why", ""))
    path, version = models.save(bench.settings, name, start, added, state.formula, why, state.source)
    return JSONResponse({"done": f"{path}: version {version} is saved"})


@router.post("/missing/formula")
def formula(body: RequestBody) -> JSONResponse:
    """The address of the page with a formula added to the model; an invalid formula is refused."""
    from inertial import effects

    state = state_at(body, MissingPage)
    written = str(body.get("formula", "")).strip()
    with effects.additions_forgotten():
        (name,) = use_written_formulas([written], "formula")
    others = tuple(text for text in state.formula if text.partition("=")[0].strip().lower() != name)
    added = tuple(effect for effect in state.added if effect != name)
    return JSONResponse({"address": state.address(formula=(*others, written), added=(*added, name))})


def _diagnosed(bench: Workbench, state: MissingPage) -> Diagnosed | None:
    return bench.done("diagnose", state)


def _chart(bench: Workbench, state: MissingPage, name: str) -> Chart | None:
    if name == "samples":
        samples, out_unit, title = samples_of(bench, state.source, state.dwell)
        return samples_chart(samples, title, out_unit)
    if name == "ladder":
        rows = bench.done("ladder", state)
        return None if rows is None else evolution_chart(rows)
    diagnosed = _diagnosed(bench, state)
    return (
        None if diagnosed is None or diagnosed.table is None else _of_residuals(diagnosed, diagnosed.table, state, name)
    )


def _of_residuals(diagnosed: Diagnosed, table: ResidualTable, state: MissingPage, name: str) -> Chart | None:
    views = {f"effect-{k}": view for k, view in enumerate(diagnosed.views)}
    if name not in {"sphere", "drivers", "slots", *views}:
        raise no_figure(name)
    before, unit = diagnosed.before, table.index_of(state.unit)
    if name in views:
        return effect_chart(views[name], table.pick)
    if name == "slots":
        return slot_chart(table)
    if name == "drivers":
        return quantity_chart(table, before, _quantity(diagnosed, state), unit, state.colour)
    shown = [("before", before), ("after", table.residual)]
    models = [(name, residual[unit]) for name, residual in shown if residual is not None]
    return pose_chart(table.units[unit], table.axes, table.force[unit], models, partial(table.pick, unit))


def _quantity(diagnosed: Diagnosed, state: MissingPage) -> str:
    """The quantity of the address, else that of the missing effect, else that which the residual follows most, else force."""
    known = {} if diagnosed.table is None else diagnosed.table.drivers
    first = "" if diagnosed.table is None else diagnosed.table.first
    followed = [first, *(str(row["driver"]) for row in diagnosed.document["where"])]
    return next((name for name in (state.against, *followed) if name in known), "force")
