"""The person at the station: what is asked of them, and when. Who carries the question is another module's business."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

from pipelines.jobs.seating import disagreements
from pipelines.tables.frames import rows_of
from schemas.errors import OperatorNeeded

if TYPE_CHECKING:
    from collections.abc import Callable

    from pipelines.archive import Run
    from pipelines.chain.runner import Done, Runner
    from pipelines.jobs.job import Job

Kind = Literal["load", "confirm", "trouble", "unload", "approve"]
Answer = Literal["go", "stop"]
JUDGED = "grade"  # the stage after which each unit has its result: the operator unloads then, and the report is made after it


@dataclass(frozen=True)
class Prompt:
    """Something that a person has to do before the run goes on.

    ``load``: seat the units. ``confirm``: the slots say something else than the slot map. ``trouble``: the station needs a hand;
    the run goes on after its last record. ``unload``: take the units out, each slot with its result. ``approve``: station time
    beyond what was asked for.
    """

    kind: Kind
    run: str
    text: str
    slots: tuple[tuple[int, str], ...] = ()


class Operator(Protocol):
    """Whoever can be asked."""

    def ask(self, prompt: Prompt) -> Answer:
        """``go`` when it is done, ``stop`` to leave it."""
        ...


class Attendance:
    """A run with somebody beside it: asked before the lot is measured, when the station needs a hand, and when it is judged."""

    def __init__(self, operator: Operator, job: Job, run: str) -> None:
        self.operator, self.job, self.run = operator, job, run
        self._seated = False  # the units were measured here and are still in their slots

    def capture(self, runner: Runner, stage: Callable[[], Done]) -> Done:
        """The capture done, with everything asked that it takes."""
        records = runner.archive.capture(self.job.capture_id)
        if records.is_complete():
            return stage()
        if not records.finished():
            self._need("load", "seat the units as listed", lot=True)
        self._confirm()
        while True:
            try:
                done = stage()
            except OperatorNeeded as problem:
                self._need("trouble", str(problem))
                continue
            self._seated = True
            return done

    def unload(self, run: Run) -> None:
        """Shows what each slot came to, and asks for the units to be taken out; nothing where they were not measured here."""
        if not self._seated:
            return
        self._seated = False
        results = {str(row["unit"]): _result(row) for row in rows_of(run.table("grades"))}
        passed = sum(text.startswith("pass") for text in results.values())
        text = f"{passed} of {len(results)} passed; take the units out and sort them as listed"
        slots = tuple((u.slot, f"{u.serial}  {results.get(u.serial, 'no result')}") for u in self.job.lot.units)
        self._ask(Prompt("unload", self.run, text, slots))

    def _confirm(self) -> None:
        """Asks until the slots say what the slot map says."""
        while wrong := seated_otherwise(self.job):
            self._need("confirm", "; ".join(wrong) + "; seat them as the slot map says")

    def _need(self, kind: Kind, text: str, *, lot: bool = False) -> None:
        slots = tuple((unit.slot, unit.serial) for unit in self.job.lot.units) if lot else ()
        self._ask(Prompt(kind, self.run, text, slots))

    def _ask(self, prompt: Prompt) -> None:
        if self.operator.ask(prompt) == "stop":
            message = f"run {self.run}: stopped at '{prompt.kind}' by the operator ({prompt.text})"
            raise OperatorNeeded(f"{message}; give the command again to go on")


def _result(row: dict[str, Any]) -> str:
    """What a unit came to: passed with its grade, or what it failed or was refused for."""
    grade = f", grade {row['grade']}" if row["outcome"] == "pass" and row["grade"] else ""
    why = f": {row['reasons']}" if row["outcome"] != "pass" and row["reasons"] else ""
    return f"{row['outcome']}{grade}{why}"


def seated_otherwise(job: Job) -> list[str]:
    """What the slots of a job's station say against its lot."""
    from stations import open_station

    with open_station(job.station, job.lot) as station:
        return disagreements(station, job.lot)
