"""The process that measures one lot, with the pages as operator: ``python -m … FOLDER``."""

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any, NoReturn

from pipelines.archive import Archive, files
from pipelines.chain.attendance import JUDGED, Answer, Attendance, Prompt
from pipelines.chain.runner import Runner
from pipelines.stages.figures import plain_reason
from pipelines.tables.frames import rows_of
from pipelines.workbench.services.lots import request_of, write_state
from schemas.errors import OperatorNeeded, TumblelineError
from schemas.installed import not_installed

POLL_S = 0.2
EVERY_S = 0.25


class Pages:
    """The state of a lot, written for the pages; and the answers of the pages."""

    def __init__(self, folder: Path, before: dict[str, Any]) -> None:
        self._folder, self._told = folder, 0.0
        self._state: dict[str, Any] = {
            **before,
            "pid": os.getpid(),
            "question": None,
            "problem": "",
            "phase": "starting",
        }
        self.put()

    def put(self, **changes: Any) -> None:
        """Write the state with some values changed."""
        self._state |= changes
        write_state(self._folder, self._state)
        self._told = time.monotonic()

    def progress(self, done: int, total: int, note: str) -> None:
        """Progress of the capture; not every record writes a file."""
        if time.monotonic() - self._told > EVERY_S or done == total:
            self.put(phase="measuring", done=done, total=total, note=note)

    def ask(self, prompt: Prompt) -> Answer:
        """The answer of the user of a page, without time limit."""
        number = int(self._state["number"]) + 1
        question = {"kind": prompt.kind, "text": prompt.text, "slots": [list(slot) for slot in prompt.slots]}
        self.put(phase="asks", question=question, number=number)
        path = self._folder / f"answer-{number}.json"
        while not path.is_file() or path.stat().st_size == 0:
            time.sleep(POLL_S)
        reply = str(files.read_json(path)["answer"])
        self.put(phase="measuring", question=None)
        return "stop" if reply == "stop" else "go"


def measure(folder: Path) -> str:
    """Measure the lot of a folder; the phase in which it ended."""
    request = files.read_json(folder / "request.json")
    pages = Pages(folder, files.read_json(folder / "state.json"))
    signal.signal(signal.SIGTERM, _stopped)
    try:
        _measured(request, pages)
    except KeyboardInterrupt:
        pages.put(phase="stopped", question=None, note="stopped; the station is in the safe state")
        return "stopped"
    except OperatorNeeded as problem:
        pages.put(phase="stopped", question=None, note="", problem=str(problem))
        return "stopped"
    except TumblelineError as problem:
        pages.put(phase="failed", question=None, problem=str(problem))
        return "failed"
    except Exception as problem:
        defect = f"a defect of the program: {type(problem).__name__}: {problem}"
        pages.put(phase="failed", question=None, problem=not_installed(problem) or defect)
        raise
    return "done"


def _measured(request: dict[str, Any], pages: Pages) -> None:
    archive = Archive(request["archive"])
    job = request_of(request).job(archive)
    runner = Runner(job, archive, pages.progress)
    pages.put(run=runner.run.id)
    beside = Attendance(pages, job, runner.run.id)
    beside.capture(runner, lambda: runner.stage("capture"))
    for done in runner.all():
        pages.put(phase="computing", note=done.stage, question=None)
        if done.stage == "fit" and (full := runner.full_plan()) is not None:
            for other in full.all():
                pages.put(phase="computing", note=f"full plan: {other.stage}", question=None)
        if done.stage == JUDGED:
            grades = rows_of(runner.run.table("grades"))
            pages.put(results=[[int(row["slot"]), _result(row)] for row in grades])
            beside.unload(runner.run)
    pages.put(phase="done", note="", question=None)


def _result(row: dict[str, Any]) -> str:
    why = f": {plain_reason(row['reasons'])}" if row["reasons"] and row["outcome"] != "pass" else ""
    return f"{row['outcome']}{why}"


def _stopped(number: int, frame: object) -> NoReturn:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(0 if measure(Path(sys.argv[1])) in {"done", "stopped"} else 3)
