"""Two models on the same dwells: verdicts, residuals on one scale, and the coefficients that differ."""

from typing import Any

import numpy as np
from fastapi import APIRouter, Request
from starlette.responses import Response

from inertial import effects
from pipelines.drawing import Chart
from pipelines.report.diagnosis_pictures import quantity_chart
from pipelines.report.numbers import significant, with_uncertainty
from pipelines.workbench.pages import Workbench, asked, figure, no_figure, not_known, page, table_csv
from pipelines.workbench.services import models, requests, sources
from pipelines.workbench.services.work import Diagnosed
from pipelines.workbench.state import MissingPage, TwoModelsPage
from schemas.errors import TumblelineError, WrongUse

router = APIRouter()
MOST = 60
COVERAGE = 2.0
NAMES = ("first model", "second model")


@router.get("/two-models")
def two_models(request: Request) -> Response:
    """The page; it asks for one missing result after the other."""
    bench, state, problems = asked(request, TwoModelsPage)
    sides: tuple[MissingPage, ...] = ()
    found: list[Diagnosed | None] = []
    rows, waiting = None, None
    try:
        state = state.model_copy(update={"source": sources.resolve(bench.settings, state.source, "two models")})
        sides = requests.two_models(bench.settings, state)
        works = [("diagnose", side) for side in sides] + [("coefficients", state)]
        results = [bench.work(kind, content, problems) for kind, content in works]
        *found, rows = [result for result, _ in results]
        pending = ((*work, job) for work, (result, job) in zip(works, results, strict=True) if result is None)
        waiting = next(pending, None)
    except TumblelineError as problem:
        problems.append(str(problem))
    table = next(
        (diagnosed.table for diagnosed in found if diagnosed is not None and diagnosed.table is not None), None
    )
    problems += not_known(state, unit=table.units, against=table.drivers) if table is not None else []
    shown = sorted(rows or (), key=lambda row: not np.isfinite(row["change"]))[:MOST]  # what one alone has comes last
    return page(
        request, "two_models.html", state, problems, sides=sides, found=found, waiting=waiting, names=NAMES,
        effects=[name for name in effects.catalogue() if sides and name not in sides[-1].judged],
        rows=None if rows is None else [_worded(row, sides) for row in shown], count=len(rows or ()),
        sources=sources.sources(bench.settings), models=models.models(bench.settings), offered=_offered(state, found),
        against=_quantity(state, found), drivers=[] if table is None else [(k, label) for k, (label, _) in table.drivers.items()],
        units=() if table is None else table.units, unit="" if table is None else table.units[table.index_of(state.unit)],
    )  # fmt: skip


@router.get("/two-models/coefficients.csv")
def coefficients(request: Request) -> Response:
    """The coefficients that differ."""
    bench, state, _ = asked(request, TwoModelsPage)
    return table_csv(bench.finished("coefficients", state), "two-models")


@router.get("/two-models/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """The residuals of both models on one scale."""
    if name != "residuals":
        raise no_figure(name)
    bench, state, _ = asked(request, TwoModelsPage)
    return figure(_chart(bench, state), ending, "two-models")


def _chart(bench: Workbench, state: TwoModelsPage) -> Chart | None:
    found: list[Any] = [bench.done("diagnose", side) for side in requests.two_models(bench.settings, state)]
    first, second = (None if diagnosed is None else diagnosed.table for diagnosed in found)
    if first is None or second is None:
        return None
    if first.units != second.units or first.residual.shape != second.residual.shape:
        raise WrongUse(
            "figure: the two models were judged on different units or dwells, the same are needed; "
            "look at each on the page Missing effects"
        )
    quantity = _quantity(state, found)
    return quantity_chart(second, first.residual, quantity, first.index_of(state.unit), names=NAMES)


def _worded(row: dict[str, Any], sides: tuple[MissingPage, ...]) -> dict[str, Any]:
    """A coefficient with its values, their U, and the difference with its own, as texts; empty where a model does not have it."""
    values = [(float(row[side]), COVERAGE * float(row[f"u_{side}"])) for side in ("a", "b")]
    texts = [with_uncertainty(*value) if np.isfinite(value[0]) else ("", "") for value in values]
    change, expanded = float(row["change"]), _of_difference(values[0][1], values[1][1], sides)
    compared = np.isfinite(change) and expanded > 0.0
    return row | {
        "sides": texts,
        "difference": with_uncertainty(change, expanded) if np.isfinite(change) else ("", ""),
        "over": significant(change / expanded, 2) if compared else "",
    }


def _of_difference(first: float, second: float, sides: tuple[MissingPage, ...]) -> float:
    """Upper limit of U of a difference of two coefficients that share their noise, from U of both.

    Generalised least squares with one covariance of the dwells for both: the estimate of a model is not correlated with what a
    larger one changes in it, so the variance of the change is that of the larger model less that of the smaller one (Hausman
    1978, 10.2307/1913827). Each model estimates its own noise, so this holds as far as their weights agree; the larger one has
    the noise without what the smaller lacks. Of other pairs nothing is known of the correlation: the sum is never too small.
    With k = 2 noise exceeds U in up to 5 % of the rows.
    """
    a, b = (set(side.judged) for side in sides)
    return second if a <= b else first if b <= a else first + second


def _quantity(state: TwoModelsPage, found: list[Diagnosed | None]) -> str:
    """The quantity of the address, else that on which the additional effect of the second model depends, else force."""
    tables = [diagnosed.table for diagnosed in found[::-1] if diagnosed is not None and diagnosed.table is not None]
    wanted = [state.against, *(table.first for table in tables)]
    return next((name for name in wanted if tables and name in tables[0].drivers), "force")


def _offered(state: TwoModelsPage, found: list[Diagnosed | None]) -> list[str]:
    """The effects that the diagnosis of the first model names and the second lacks."""
    if not found or found[0] is None:
        return []
    groups = [group for group in found[0].document["classes"] if group["scope"] != "data"]
    named = [*found[0].document["recommended"], *(name for group in groups for name in group["effects"])]
    return [name for name in dict.fromkeys(named) if name not in state.added]
