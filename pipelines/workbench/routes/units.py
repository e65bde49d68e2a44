"""Search of units and runs."""

from itertools import islice

from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.archive.listing import RunInfo, info_of
from pipelines.workbench.pages import Workbench, asked, page, table_csv
from pipelines.workbench.state import ROWS, UnitsPage
from schemas.errors import TumblelineError

router = APIRouter()
HEADING, ORDER, ADDRESS = "Units", 10, "/units"
EVERYTHING = 1_000_000
NEWEST, MOST_LOOKED = 12, 500
"""Runs that are shown, and that are looked at for those of a state."""


@router.get("/units")
def units(request: Request) -> Response:
    """A page of units, newest first."""
    bench, state, problems = asked(request, UnitsPage)
    rows = bench.index.ask(state.question()).documents()
    counts = {str(name): int(count) for name, count in bench.index.ask(yield_question(state)).rows}
    chosen = bool(state.runs or state.search)
    newest = bench.index.ask(newest_question(MOST_LOOKED if chosen else NEWEST)).rows
    infos = (info for name, _ in newest if (info := _info(bench, str(name), problems)) is not None)
    runs = list(islice((info for info in infos if not chosen or is_of(info, state)), NEWEST))
    return page(
        request, "units.html", state, problems, rows=rows, counts=counts, total=sum(counts.values()), per_page=ROWS,
        runs=runs, run_count=newest[0][1] if newest else 0,
    )  # fmt: skip


@router.get("/units/table.csv")
def table(request: Request) -> Response:
    """The units of the search as a CSV file."""
    bench, state, _ = asked(request, UnitsPage)
    return table_csv(bench.index.ask(state.model_copy(update={"page": 1}).question(EVERYTHING)).documents(), "units")


def _info(bench: Workbench, name: str, problems: list[str]) -> RunInfo | None:
    """The line of a run; None for one that cannot be read, whose problem is added."""
    try:
        return info_of(bench.archive.run(name))
    except TumblelineError as problem:
        problems.append(str(problem))
        return None


def is_of(run: RunInfo, state: UnitsPage) -> bool:
    """Whether a run is of a state of the search and has its text in its name or in that of a unit, graded or not."""
    passed = None if run.graded is None else run.passed == run.graded
    kinds = {"": True, "unfinished": not run.finished, "finished": run.finished, "all passed": passed is True}
    found = any(state.search.lower() in name.lower() for name in (run.id, *run.units))
    return found and kinds.get(
        state.runs, passed is False if state.runs == "not all passed" else run.verdict == state.runs
    )


def yield_question(page: UnitsPage) -> str:
    """Number of units by outcome, in SQL."""
    return (
        f"SELECT outcome, count(*) AS units FROM units JOIN runs USING (run) WHERE {page.conditions()} GROUP BY outcome"  # noqa: S608 - texts are quoted
    )


def newest_question(count: int) -> str:
    """The newest runs, and how many there are, in SQL."""
    return f"SELECT run, count(*) OVER () AS runs FROM runs ORDER BY started DESC, run DESC LIMIT {count}"  # noqa: S608 - a number
