"""Common parts of pages: the workbench, templates, figures in three formats, and errors as sentences."""

import hashlib
import math
import secrets
import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, TypeVar
from urllib.parse import parse_qsl, urlsplit

import pandas as pd
from fastapi import Body, Request
from jinja2 import Environment, FunctionLoader, StrictUndefined
from pydantic import AfterValidator
from starlette.responses import HTMLResponse, JSONResponse, Response

from pipelines.archive import Archive
from pipelines.drawing import Chart, csv_text, plotly_figure
from pipelines.drawing.chart import shortened
from pipelines.drawing.picture import picture, safe_cell
from pipelines.report.numbers import significant
from pipelines.report.unit_panels.budget import without_nothing
from pipelines.stages.figures import plain_reason
from pipelines.workbench.services import requests
from pipelines.workbench.services.index import RecentIndex
from pipelines.workbench.services.jobs import BackgroundJob, Jobs
from pipelines.workbench.services.uploads import in_fields
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import PageState
from schemas.errors import TumblelineError, WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.units import MICRO

State = TypeVar("State", bound="PageState")


def _written(body: dict[str, Any]) -> dict[str, Any]:
    """The body of a request, whose texts may be file names and may be quoted in answers."""
    for key, value in body.items():
        for text in (key, value):
            if isinstance(text, str) and any(letter == "\0" or "\ud800" <= letter <= "\udfff" for letter in text):
                raise WrongUse(
                    f"request: {shown(key, 40)} has a null character or half of a character, a text is needed; correct it"
                )
    return body


RequestBody = Annotated[dict[str, Any], Body(), AfterValidator(_written)]
"""Body of a change request, JSON."""
PARAMETER = {"json": "application/json", "csv": "text/csv; charset=utf-8", "png": "image/png"}


@dataclass
class Workbench:
    """State shared by the handlers.

    boot : id of this process of the server · navigation : heading and address of the pages, in order
    """

    settings: WorkbenchSettings
    jobs: Jobs
    boot: str = field(default_factory=lambda: secrets.token_hex(8))
    navigation: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])
    index: RecentIndex = field(init=False)

    def __post_init__(self) -> None:
        """The index is shared by all handlers."""
        self.index = RecentIndex(self.settings.archive)

    @property
    def archive(self) -> Archive:
        """The archive of the workbench."""
        return Archive(self.settings.archive)

    def work(self, kind: str, state: PageState, problems: list[str]) -> tuple[Any, BackgroundJob | None]:
        """Result and job of the work that a page needs, None while there is none; what refuses it is added to ``problems``."""
        try:
            _, content = requests.KINDS[kind][1](self.settings, state)
        except TumblelineError as problem:
            problems.append(in_fields(str(problem), kind))
            return None, None
        if kind == "import" and (made := self.jobs.result(kind, content)) and made["run"] not in self.archive.run_ids():
            self.jobs.forget(kind, content)  # its run was removed since
        job = self.jobs.known(kind, content)  # first: a job that ends between the looks has its result in the second
        return self.jobs.result(kind, content), job

    def done(self, kind: str, state: PageState) -> Any:
        """The result of the work that a page needs; None while there is none."""
        return self.jobs.result(kind, requests.KINDS[kind][1](self.settings, state)[1])

    def finished(self, kind: str, state: PageState) -> Any:
        """The result of the work that a page needs; refused while there is none."""
        found = self.done(kind, state)
        if found is None:
            raise WrongUse(f"{kind}: not finished; wait until it is done")
        return found


def workbench_of(request: Request) -> Workbench:
    """The workbench of a request."""
    bench: Workbench = request.app.state.workbench
    return bench


def asked(request: Request, kind: type[State]) -> tuple[Workbench, State, list[str]]:
    """The workbench of a request, the state of its address, and messages on invalid parts."""
    return workbench_of(request), *kind.parse(request.query_params.multi_items())


def not_known(state: PageState, **known: Collection[str]) -> list[str]:
    """Messages on values of an address that are none of those that the page knows."""
    return [
        f"address: {name} = {shown(value, 60)} is not known here ({did_you_mean(value, names)}); it is ignored"
        for name, names in known.items()
        if (value := str(getattr(state, name))) and value not in names
    ]


def state_at(body: Mapping[str, Any], kind: type[State]) -> State:
    """The state of the page that sent a form: its ``address``."""
    return kind.parse(page_address(body)[1])[0]


def page_address(body: Mapping[str, Any]) -> tuple[str, list[tuple[str, str]]]:
    """Path and query of the ``address`` of a form."""
    text = str(body.get("address", ""))
    try:
        parts = urlsplit(text)
    except ValueError:
        raise WrongUse(f"request: {shown(text, 80)} is no address of a page; reload the page") from None
    return parts.path, parse_qsl(parts.query, keep_blank_values=True)


def page(
    request: Request,
    template: str,
    state: PageState,
    problems: list[str] | None = None,
    status: int = 200,
    **values: Any,
) -> HTMLResponse:
    """A page as HTML."""
    bench = workbench_of(request)
    text = _environment().get_template(template).render(
        state=state, problems=problems or [], bench=bench, command=state.command(bench.settings.archive),
        line=lambda *words: shlex.join(["tumbleline", *words, "--archive", bench.settings.archive]),
        may_change=bool(getattr(request.state, "may_change", False)), static=static_version(), path=request.url.path,
        number=significant, micro=MICRO, finite=math.isfinite, **values,
    )  # fmt: skip
    return HTMLResponse(text, status)


def part_of(request: Request) -> str:
    """The part of a page that the browser replaces; empty where it needs the whole page."""
    return request.headers.get("x-part", "")


def page_part(request: Request, template: str, state: PageState, **values: Any) -> HTMLResponse:
    """A part of a page, with the command line of its state: what a click changes, without the work of the whole page."""
    return page(request, "part.html", state, inner=template, **values)


def figure(chart: Chart | None, ending: str, name: str) -> Response:
    """A chart as a figure for the page, as its numbers, or as a picture."""
    if chart is None:
        raise WrongUse(f"figure {name}: it is not computed yet; wait until the work is done")
    if ending == "json":
        return JSONResponse(plotly_figure(chart))
    if ending == "csv":
        return Response(csv_text(chart), media_type=PARAMETER["csv"], headers=saved_as(f"{name}.csv"))
    if ending == "png":
        return Response(picture(chart, ".png"), media_type=PARAMETER["png"], headers=saved_as(f"{name}.png"))
    raise WrongUse(f"figure {name}: '{ending[:10]}', one of json, csv, png is needed")


def no_figure(name: str) -> WrongUse:
    """The refusal of a figure that a page does not have."""
    return WrongUse(f"figure: none of this page is called '{name[:40]}'")


def saved_as(name: str) -> dict[str, str]:
    """Headers of a download with a file name."""
    safe = "".join(letter if letter.isascii() and (letter.isalnum() or letter in "._-") else "_" for letter in name)
    return {"content-disposition": f'attachment; filename="{safe}"'}


def table_csv(rows: Sequence[Mapping[str, Any]], name: str) -> Response:
    """Rows as comma-separated values; a row may lack some of the columns."""
    import csv
    import io

    sink = io.StringIO()
    if rows:
        writer = csv.DictWriter(sink, list(dict.fromkeys(key for row in rows for key in row)), lineterminator="\n")
        writer.writeheader()
        writer.writerows({key: safe_cell(value) for key, value in row.items()} for row in rows)
    return Response(sink.getvalue(), media_type=PARAMETER["csv"], headers=saved_as(f"{name}.csv"))


def run_table(bench: Workbench, run: str, name: str) -> pd.DataFrame:
    """A table of a run, cached while its manifest does not change."""
    stored = bench.archive.run(run)
    path = stored.path / f"{name}.json"
    when = path.stat().st_mtime_ns if isinstance(path, Path) and path.is_file() else 0
    return _table(bench.settings.archive, stored.id, name, when)


@lru_cache(maxsize=48)
def _table(archive: str, run: str, name: str, when: int) -> pd.DataFrame:
    return Archive(archive).run(run).table(name)


def samples_of(bench: Workbench, run: str, dwell: str) -> tuple[pd.DataFrame, str, str]:
    """Samples of a dwell ``UNIT:DWELL``, from the capture of a run or an imported record, the unit of their values, and a title.

    Raises
    ------
    WrongUse
        There is no such dwell, or its samples were not recorded.
    """
    stored = bench.archive.run(run)
    unit, _, number = dwell.rpartition(":")
    table = run_table(bench, run, "dwells")
    rows = table[(table["unit"] == unit) & (table["dwell"].astype(str) == number)]
    if rows.empty:
        raise WrongUse(f"run {stored.id} has no dwell '{dwell[:80]}'; click a residual")
    row = rows.iloc[0]
    record = int(row.get("record", number))
    if stored.records is not None:
        tables = list(stored.records.samples({record}))
    elif "samples" in stored.tables():
        samples = run_table(bench, run, "samples")
        tables = [samples[samples["record"] == record]]
    else:
        raise WrongUse(f"run {stored.id} was imported as dwells: its samples were not recorded")
    samples_of_unit = [of_unit for part in tables if len(of_unit := part[part["unit"] == unit])]
    if not samples_of_unit:
        raise WrongUse(f"run {stored.id}: no samples of dwell {number} of unit {unit} are stored")
    pose = str(row.get("pose", ""))
    title = f"Unit {unit}, dwell {number}{', pose ' + pose if pose else ''}"
    return pd.concat(samples_of_unit, ignore_index=True), str(row.get("out_unit", "")), title


@cache
def static_version() -> str:
    """Part of the addresses of scripts and styles that changes with their content, so that browsers can cache them."""
    digest = hashlib.sha256()
    shared = files("pipelines.drawing") / "paint.js"
    for file in (*sorted((files("pipelines.workbench") / "static").iterdir(), key=lambda path: path.name), shared):
        if file.is_file():
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:12]


_TEMPLATES = {"sections.html": files("pipelines.report") / "sections.html"}
"""Templates of reports that pages use as they are."""


@cache
def _environment() -> Environment:
    loader = FunctionLoader(
        lambda name: (_TEMPLATES.get(name) or files("pipelines.workbench") / "templates" / name).read_text("utf-8")
    )
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    filters: dict[str, Any] = {"short": short, "plain_reason": plain_reason, "tuple_of": tuple, "first_of": first_of}
    made.filters.update(filters, without_nothing=without_nothing)
    return made


def first_of(values: list[Any], count: int) -> list[Any]:
    """The first of several values."""
    return values[:count]


def short(text: object, most: int = 28) -> str:
    """A long name shortened in the middle; the full name is in the title attribute."""
    return shortened(str(text), most)
