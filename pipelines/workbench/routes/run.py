"""A run: its units, each with its result and figures."""

from collections.abc import Sequence

from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.certificates.ledger import stated
from pipelines.stages.judge import verdict_of
from pipelines.tables.frames import rows_of
from pipelines.workbench.pages import Workbench, asked, page, run_table, saved_as, table_csv
from pipelines.workbench.state import MissingPage, RunPage
from schemas.errors import TumblelineError, WrongUse

router = APIRouter()
SHOWN = (
    "residual_rms_ug",
    "verification_norm_ug",
    "bias_error_ug",
    "velocity_random_walk_ug_rtHz",
    "bias_instability_ug",
)


@router.get("/run")
def run(request: Request) -> Response:
    """Result and figures of every unit of a run."""
    bench, state, problems = asked(request, RunPage)
    stored = bench.archive.run(state.run)
    state = state.model_copy(update={"run": stored.id})
    tables, about = stored.tables(), stored.about
    grades = rows_of(run_table(bench, stored.id, "grades").sort_values("slot")) if "grades" in tables else []
    figures = run_table(bench, stored.id, "figures") if "figures" in tables else None
    cells: dict[str, dict[str, float]] = {}
    for row in [] if figures is None else rows_of(figures[figures["figure"].isin(SHOWN)]):
        cells.setdefault(str(row["unit"]), {})[str(row["figure"])] = float(row["value"])
    try:
        ledger = stated(stored, [str(row["unit"]) for row in grades])
        certificates = {unit: one.sentence() for unit, one in ledger.items()}
    except TumblelineError as problem:
        certificates = {}
        problems.append(str(problem))
    events = rows_of(run_table(bench, stored.id, "events")) if "events" in tables else []
    return page(
        request, "run.html", state, problems, run=stored, about=about, grades=grades, cells=cells, shown=SHOWN, tables=tables,
        certificates=certificates, events=events, judged=_judged(bench, stored.id, tables),
    )  # fmt: skip


def _judged(bench: Workbench, run: str, tables: Sequence[str]) -> tuple[bool | None, str]:
    """Whether the model is adequate, and why it cannot be judged: of the archive, else of a diagnosis since the server began."""
    verdict = verdict_of(run_table(bench, run, "verdict")) if "verdict" in tables else None
    if verdict is not None:
        return verdict["adequate"], verdict["reason"] or ""
    diagnosed, _ = bench.work("diagnose", MissingPage(source=run), [])
    return (None, "") if diagnosed is None else (diagnosed.document["adequate"], diagnosed.document["reason"] or "")


@router.get("/run/table/{name}.csv")
def table(request: Request, name: str) -> Response:
    """A table of a run."""
    bench, state, _ = asked(request, RunPage)
    return table_csv(rows_of(run_table(bench, state.run, name)), f"{state.run}-{name}")


@router.get("/run/report.html")
def report(request: Request) -> Response:
    """The report of a run, as a file."""
    bench, state, _ = asked(request, RunPage)
    stored = bench.archive.run(state.run)
    if not stored.report.is_file():
        raise WrongUse(f"run {stored.id} has no report; make it with 'tumbleline show {stored.id} --report'")
    return Response(stored.report.read_bytes(), media_type="text/html", headers=saved_as(f"{stored.id}.html"))
