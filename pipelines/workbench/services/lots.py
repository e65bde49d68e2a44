"""Lots on the station: each is measured by a separate process that survives the server; its state is in small files.

``lots/<id>/request.json`` is the request, ``state.json`` its progress, ``answer-<n>.json`` the answer to question n,
created once: of two answers to one question the second is refused.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

from pipelines.archive import Archive, files
from pipelines.archive.keys import digest
from pipelines.jobs.job import Request
from pipelines.workbench.settings import WorkbenchSettings
from schemas.errors import TumblelineError, WrongUse
from stations.safety.lease_files import is_process

FOLDER = "lots"
ENDED = frozenset({"done", "stopped", "failed", "interrupted"})
PAUSED = "paused"
"""Name of the phase, and of the file that keeps it: a lot that was stopped to be continued holds its station."""
NEWEST = 12
TOLD = ("done", "total", "note", "question", "number", "problem", "run", "since")
"""What the process of a lot tells of its state, by the names of :class:`LotState`."""
_STARTING = Lock()  # two pages that start at once
SAFE_S, POLL_S = 20.0, 0.1
"""Time that the processes of lots are given at the end of the server, and how often they are looked at, s."""


class Stale(TumblelineError):
    """An action based on an outdated state."""


@dataclass(frozen=True)
class LotState:
    """The state of a lot.

    phase : ``starting``, ``measuring``, ``asks``, ``computing``, ``done``, ``paused``, ``stopped``, ``failed``,
    ``interrupted`` · station : file of the station; empty for the simulated one
    number : of the question, which its answer names · slots : slot, serial, result
    """

    id: str
    phase: str
    recipe: str
    units: tuple[str, ...]
    slots: tuple[tuple[int, str, str], ...] = ()
    done: int = 0
    total: int = 0
    note: str = ""
    question: dict[str, Any] | None = None
    number: int = 0
    problem: str = ""
    run: str = ""
    since: float = 0.0
    pid: int = 0
    station: str = ""

    @property
    def ended(self) -> bool:
        """Whether the lot has ended."""
        return self.phase in ENDED

    @property
    def idle(self) -> bool:
        """Whether no process works on the lot: it has ended, or is paused."""
        return self.ended or self.phase == PAUSED


def start(settings: WorkbenchSettings, lot_request: Request) -> LotState:
    """A new lot on a station, or the continuation of the same stopped lot.

    Raises
    ------
    TumblelineError
        The recipe, the seats or the faults are invalid; nothing was moved.
    """
    twice = next((unit for unit in lot_request.units if lot_request.units.count(unit) > 1), None)
    if twice is not None:
        raise WrongUse(f"lot: serial '{twice}' is in two slots, each unit has one; scan the slots again")
    job = lot_request.job(Archive(settings.archive))
    content = {
        **lot_request.parameters(),
        "archive": settings.archive,
        "seats": [[u.slot, u.serial] for u in job.lot.units],
    }
    name = digest(content)[:12]
    with _STARTING:
        for other in lots(settings):
            if not other.ended and other.id != name and other.station == str(lot_request.station or ""):
                raise WrongUse(
                    f"lot: the station has lot {other.id} ({other.phase}), one lot at a time is possible; finish or stop "
                    "that one first"
                )
        folder = settings.folder / FOLDER / name
        known = state_of(folder) if (folder / "state.json").is_file() else None
        if known is not None and not known.idle:
            return known
        folder.mkdir(parents=True, exist_ok=True)
        (folder / PAUSED).unlink(missing_ok=True)
        for old in folder.glob("answer-*.json"):
            old.unlink()
        files.publish(folder / "request.json", files.json_bytes(content), "lot", files.ELSEWHERE)
        now = {"phase": "starting", "since": time.time(), "number": 0 if known is None else known.number}
        write_state(folder, now)
        with (folder / "log.txt").open("ab") as log:
            process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-m", "pipelines.workbench.services.lot_process", str(folder)],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        write_state(folder, now | {"pid": process.pid})  # so that it can be stopped before it tells of itself
        return state_of(folder)


def again(settings: WorkbenchSettings, name: str) -> LotState:
    """The continuation of a stopped lot."""
    return start(settings, request_of(files.read_json(folder_of(settings, name) / "request.json")))


def request_of(content: Mapping[str, Any]) -> Request:
    """The request of a lot, from its file."""
    station = Path(content["station"]) if content["station"] else None
    lists = {name: tuple(content[name]) for name in ("units", "slots", "faults")}
    return Request(content["recipe"], station, seed=content["seed"], repeat=int(content["repeat"]), **lists)


def answer(settings: WorkbenchSettings, name: str, number: int, reply: str) -> LotState:
    """The answer to question ``number`` of a lot.

    Raises
    ------
    Stale
        The question has changed, or was answered already.
    """
    folder = folder_of(settings, name)
    now = state_of(folder)
    if now.phase != "asks" or now.number != number:
        raise Stale(f"lot {name}: the question was answered already; the page shows the present question")
    try:
        handle = os.open(folder / f"answer-{number}.json", os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    except FileExistsError:
        raise Stale(f"lot {name}: another page answered the question at the same time; no action is needed") from None
    with os.fdopen(handle, "w") as file:
        json.dump({"answer": "stop" if reply == "stop" else "go"}, file)
    return now


def stop(settings: WorkbenchSettings, name: str) -> LotState:
    """Stop a lot's process after the safe state; it continues when it is started again."""
    folder = folder_of(settings, name)
    (folder / PAUSED).unlink(missing_ok=True)
    return _ended(folder)


def pause(settings: WorkbenchSettings, name: str) -> LotState:
    """Stop a lot's process after the safe state; the lot keeps its station until it is continued or stopped."""
    folder = folder_of(settings, name)
    if state_of(folder).ended:
        raise Stale(f"lot {name}: it has ended already; the page shows its present state")
    (folder / PAUSED).touch()
    return _ended(folder)


def pause_all(settings: WorkbenchSettings) -> list[str]:
    """Pause every lot that is measured, and wait until its process has made the station safe; the lots that did not in time."""
    working = [lot for lot in lots(settings) if not lot.idle]
    for lot in working:
        pause(settings, lot.id)
    end = time.monotonic() + SAFE_S
    while time.monotonic() < end and any(is_process(lot.pid) for lot in working if lot.pid):
        time.sleep(POLL_S)
    return [lot.id for lot in working if lot.pid and is_process(lot.pid)]


def _ended(folder: Path) -> LotState:
    """Ask the process of a lot to end; the page shows the phase that it writes at its end."""
    now = state_of(folder)
    if not now.idle and now.pid and is_process(now.pid):
        os.kill(now.pid, signal.SIGTERM)
    else:
        write_state(folder, files.read_json(folder / "state.json"))  # open pages look again
    return state_of(folder)


def lots(settings: WorkbenchSettings) -> list[LotState]:
    """The newest lots, the newest first."""
    top = settings.folder / FOLDER
    if not top.is_dir():
        return []
    states = [state_of(folder) for folder in top.iterdir() if (folder / "state.json").is_file()]
    return sorted(states, key=lambda state: -state.since)[:NEWEST]


def folder_of(settings: WorkbenchSettings, name: str) -> Path:
    """The folder of a lot."""
    folder = settings.folder / FOLDER / name
    if not (name.isalnum() and (folder / "state.json").is_file()):
        raise WrongUse(f"lot: none is called '{name[:40]}'; choose one of the page")
    return folder


def state_of(folder: Path) -> LotState:
    """The state of a lot; one whose process ended unexpectedly is interrupted."""
    request, now = files.read_json(folder / "request.json"), files.read_json(folder / "state.json")
    phase = str(now["phase"])
    pid = int(now.get("pid", 0))
    lost = (pid and not is_process(pid)) or (not pid and time.time() - float(now.get("since", 0.0)) > 60.0)
    if phase not in ENDED and lost:
        phase = "interrupted"
    if phase == "stopped" and (folder / PAUSED).is_file():
        phase = PAUSED
    results = {int(slot): str(text) for slot, text in now.get("results", [])}
    seats = [(int(slot), str(serial)) for slot, serial in request["seats"]]
    told = {name: now[name] for name in TOLD if name in now}
    return LotState(
        id=folder.name, phase=phase, recipe=str(request["recipe"]), units=tuple(serial for _, serial in seats),
        slots=tuple((slot, serial, results.get(slot, "")) for slot, serial in seats), pid=pid,
        station=str(request.get("station") or ""), **told,
    )  # fmt: skip


def write_state(folder: Path, content: dict[str, Any]) -> None:
    """Replace a lot's state atomically."""
    files.publish(folder / "state.json", files.json_bytes(content), "lot", files.ELSEWHERE)


def stamp(settings: WorkbenchSettings) -> str:
    """A value that changes when any lot changes."""
    top = settings.folder / FOLDER
    if not top.is_dir():
        return ""
    newest = [path.stat().st_mtime_ns for path in top.glob("*/state.json")]
    return f"{len(newest)}.{max(newest, default=0)}"
