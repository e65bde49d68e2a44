"""Lots on the station: slots as tiles, scan of serials, answers to questions, results before unloading."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, Response

from pipelines.jobs.job import Request as LotRequest
from pipelines.workbench.pages import RequestBody, asked, figure, no_figure, not_known, page, workbench_of
from pipelines.workbench.routes.station import chart_of_run, nothing_yet
from pipelines.workbench.services import lots, requests
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import OperatorPage
from schemas.errors import WrongUse, did_you_mean
from schemas.serials import refuse_unusable_serials
from schemas.station import BUILT_IN, load_station
from stations.plant.faults.catalogue import fault_rows


@dataclass(frozen=True)
class StationOfPage:
    """A station of the operator's page.

    file : None for the built-in one · slots : number of them
    """

    file: Path | None
    name: str
    slots: int
    simulated: bool

    @property
    def address(self) -> str:
        """The station as a lot names it."""
        return str(self.file or "")


def stations_of(settings: WorkbenchSettings) -> list[StationOfPage]:
    """The stations in the order of the command line; two of one name are told apart by their files.

    Raises
    ------
    RecipeInvalid
        The file of a station was changed and is invalid.
    """
    configs = [(file, load_station(file)) for file in settings.stations or (None,)]
    names = [config.name for _, config in configs]
    return [
        StationOfPage(
            file,
            config.name if names.count(config.name) == 1 else str(file or BUILT_IN),
            config.devices.slots.count,
            config.kind == "simulated",
        )
        for file, config in configs
    ]


def station_named(known: Sequence[StationOfPage], name: str) -> StationOfPage:
    """The station of this name; the first for none.

    Raises
    ------
    WrongUse
        No station has the name.
    """
    if not name:
        return known[0]
    station = next((station for station in known if station.name == name), None)
    if station is None:
        names = [station.name for station in known]
        raise WrongUse(f"station: none of this workbench is called '{name[:60]}'; {did_you_mean(name, names)}")
    return station


router = APIRouter()
HEADING, ORDER, ADDRESS = "Operator", 40, "/operator"
REMEDIES = {
    "load": "Seat each unit in its slot, then press Done.",
    "confirm": "Move the units to the slots of the list, then press Done.",
    "trouble": "Correct the station as described, then press Done: the lot continues after its last record.",
    "unload": "Remove the units and sort them by result, then press Done.",
    "approve": "Press Done to approve the extra station time, Stop to decline it.",
}


@router.get("/operator")
def operator(request: Request) -> Response:
    """The lot of the address as tiles, by default the newest; seats to scan if no lot is running."""
    bench, state, problems = asked(request, OperatorPage)
    newest, known = lots.lots(bench.settings), stations_of(bench.settings)
    chosen = next((lot for lot in newest if lot.id == state.lot), None)
    problems += not_known(state, lot=[lot.id for lot in newest])
    if chosen:  # a lot of a station that this workbench was not started with is shown with the first
        station = next((station for station in known if station.address == chosen.station), known[0])
    else:
        station = station_named(known, state.station)
    here = [lot for lot in newest if lot.station == station.address]
    shown = chosen or next((lot for lot in here if not lot.ended), None)
    return page(
        request, "operator.html", state, problems, lot=shown, lots=here, remedies=REMEDIES, station=station,
        busy={
            station.name: next((lot.phase for lot in newest if lot.station == station.address and not lot.ended), "")
            for station in known
        },
        stations=known, recipes=requests.recipes(bench.settings), slots=station.slots,
        faults=fault_rows() if station.simulated else [], live=OperatorPage(lot=shown.id) if shown else None,
    )  # fmt: skip


@router.get("/operator/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """Temperatures and angles of a lot so far."""
    bench, state, _ = asked(request, OperatorPage)
    run = lots.state_of(lots.folder_of(bench.settings, state.lot)).run
    if name != "station":
        raise no_figure(name)
    return figure(chart_of_run(bench, run) if run else nothing_yet(), ending, f"{state.lot}-station")


@router.post("/operator/scan")
def scanned(request: Request, body: RequestBody) -> JSONResponse:
    """Whether a serial can be in a slot beside those scanned before; refused with the reason where it cannot."""
    bench = workbench_of(request)
    station = station_named(stations_of(bench.settings), str(body.get("station", "")))
    slot = _slot(str(body.get("slot", "")), station.slots)
    seated = _seated(body, station)
    serial = seated.get(slot, "")
    if serial:
        refuse_unusable_serials([serial], f"slot {slot}", "scan the unit again", WrongUse)
    twice = [other for other, name in seated.items() if name == serial and other != slot]
    if twice and serial:
        raise WrongUse(
            f"slot {slot}: serial '{serial}' is in slot {twice[0]} already, each unit has one; scan another unit"
        )
    for other in lots.lots(bench.settings):
        if not other.ended and serial in other.units:
            raise WrongUse(f"slot {slot}: serial '{serial}' is measured in lot {other.id}; scan another unit")
    return JSONResponse({"done": ""})


@router.post("/operator/start")
def start(request: Request, body: RequestBody) -> JSONResponse:
    """Start a lot with the scanned serials, slot by slot."""
    bench = workbench_of(request)
    known = requests.recipes(bench.settings)
    recipe = str(body.get("recipe", ""))
    if recipe not in known:
        raise WrongUse(f"lot: no recipe is called '{recipe[:60]}'; {did_you_mean(recipe, known)}")
    station = station_named(stations_of(bench.settings), str(body.get("station", "")))
    filled = _seated(body, station)
    if not filled:
        raise WrongUse("lot: no serial number was scanned, one at least is needed; scan a unit into its slot")
    faults = str(body.get("fault", "")).split()
    repeat = str(body.get("repeat", "0") or "0")
    if (repeats := _count(repeat, 6)) < 0:
        raise WrongUse(f"lot: repeat '{repeat[:20]}', a whole number from 0 on is needed; correct it")
    slots, units = zip(*sorted(filled.items()), strict=True)
    lot_request = LotRequest(recipe, station.file, units, slots, repeat=repeats, faults=tuple(faults))
    lot = lots.start(bench.settings, lot_request)
    return JSONResponse({"address": OperatorPage(lot=lot.id).address()})


@router.post("/operator/{name}/answer")
def answer(request: Request, name: str, body: RequestBody) -> JSONResponse:
    """The answer to the question on the page; refused if the question has changed."""
    number = _count(str(body.get("number", "")), 6)
    if number < 0:
        raise WrongUse("lot: the number of the question is missing; reload the page")
    lots.answer(workbench_of(request).settings, name, number, str(body.get("answer", "")))
    return JSONResponse({"address": OperatorPage(lot=name).address()})


@router.post("/operator/{name}/{action}")
def act(request: Request, name: str, action: str) -> JSONResponse:
    """Stop the lot's process after the safe state, pause it so that the lot keeps the station, or continue the lot."""
    actions = {"stop": lots.stop, "pause": lots.pause, "continue": lots.again}
    if action not in actions:
        raise HTTPException(404)
    lot = actions[action](workbench_of(request).settings, name)
    return JSONResponse({"address": OperatorPage(lot=lot.id).address()})


def _seated(body: Mapping[str, Any], station: StationOfPage) -> dict[int, str]:
    """The serials of the form by slot; empty slots are left out."""
    return {
        _slot(key.removeprefix("slot-"), station.slots): serial
        for key, value in body.items()
        if key.startswith("slot-") and (serial := str(value).strip())
    }


def _count(text: str, digits: int) -> int:
    """A whole number of so many decimal digits at most; −1 for any other text."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= digits else -1


def _slot(text: str, slots: int) -> int:
    """The number of a slot of the station, counted from 0 as on the page."""
    number = _count(text, 4)
    if not 0 <= number < slots or text != str(number):
        raise WrongUse(
            f"lot: slot '{text[:20]}', a slot from 0 to {slots - 1} of the station is needed; reload the page"
        )
    return number
