"""Lots on the station: slots as tiles, scan of serials, answers to questions, results before unloading."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response

from pipelines.jobs.job import Request as LotRequest
from pipelines.workbench.pages import RequestBody, page, state_of, workbench_of
from pipelines.workbench.services import lots, requests, stations
from pipelines.workbench.state import OperatorPage
from schemas.errors import WrongUse, did_you_mean

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
    """The newest lot as tiles, or the one of the address; seats to scan if no lot is running."""
    bench = workbench_of(request)
    state, problems = state_of(request, OperatorPage)
    newest, known = lots.lots(bench.settings), stations.stations(bench.settings)
    chosen = next((one for one in newest if one.id == state.lot), None)
    station = stations.at(known, chosen.station) if chosen else stations.named(known, state.station)
    here = [one for one in newest if one.station == station.address]
    shown = chosen or next((one for one in here if not one.ended), None)
    return page(
        request, "operator.html", state, problems, lot=shown, lots=here, remedies=REMEDIES, station=station,
        busy={one.name: next((lot.phase for lot in newest if lot.station == one.address and not lot.ended), "") for one in known},
        stations=known, recipes=requests.recipes(bench.settings), slots=station.slots,
    )  # fmt: skip


@router.post("/operator/start")
def start(request: Request, body: RequestBody) -> JSONResponse:
    """Start a lot with the scanned serials, slot by slot."""
    bench = workbench_of(request)
    known = requests.recipes(bench.settings)
    recipe = str(body.get("recipe", ""))
    if recipe not in known:
        raise WrongUse(f"lot: no recipe is called '{recipe[:60]}'; {did_you_mean(recipe, known)}")
    station = stations.named(stations.stations(bench.settings), str(body.get("station", "")))
    filled = {
        _slot(key.removeprefix("slot-"), station.slots): serial
        for key, value in body.items()
        if key.startswith("slot-") and (serial := str(value).strip())
    }
    if not filled:
        raise WrongUse("lot: no serial number was scanned, one at least is needed; scan a unit into its slot")
    faults = str(body.get("fault", "")).split()
    repeat = str(body.get("repeat", "0") or "0")
    if not repeat.isdecimal() or not repeat.isascii() or len(repeat) > 6:
        raise WrongUse(f"lot: repeat '{repeat[:20]}', a whole number from 0 on is needed; correct it")
    slots, units = zip(*sorted(filled.items()), strict=True)
    lot_request = LotRequest(recipe, station.file, units, slots, repeat=int(repeat), faults=tuple(faults))
    lot = lots.start(bench.settings, lot_request)
    return JSONResponse({"address": OperatorPage(lot=lot.id).address()})


@router.post("/operator/{name}/answer")
def answer(request: Request, name: str, body: RequestBody) -> JSONResponse:
    """The answer to the question on the page; refused if the question has changed."""
    number = str(body.get("number", ""))
    if not number.isdecimal() or not number.isascii() or len(number) > 6:
        raise WrongUse("lot: the number of the question is missing; reload the page")
    lots.answer(workbench_of(request).settings, name, int(number), str(body.get("answer", "")))
    return JSONResponse({"address": OperatorPage(lot=name).address()})


@router.post("/operator/{name}/stop")
def stop(request: Request, name: str) -> JSONResponse:
    """Stop the lot's process after the safe state."""
    lots.stop(workbench_of(request).settings, name)
    return JSONResponse({"address": OperatorPage(lot=name).address()})


@router.post("/operator/{name}/pause")
def pause(request: Request, name: str) -> JSONResponse:
    """Stop the lot's process after the safe state; the lot keeps the station."""
    lots.pause(workbench_of(request).settings, name)
    return JSONResponse({"address": OperatorPage(lot=name).address()})


@router.post("/operator/{name}/continue")
def again(request: Request, name: str) -> JSONResponse:
    """Continue a stopped lot."""
    lot = lots.again(workbench_of(request).settings, name)
    return JSONResponse({"address": OperatorPage(lot=lot.id).address()})


def _slot(text: str, slots: int) -> int:
    """The number of a slot of the station, counted from 0 as on the page."""
    number = int(text) if text.isascii() and text.isdecimal() and len(text) <= 4 else -1
    if not 0 <= number < slots or text != str(number):
        raise WrongUse(
            f"lot: slot '{text[:20]}', a slot from 0 to {slots - 1} of the station is needed; reload the page"
        )
    return number
