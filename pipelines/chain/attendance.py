"""Questions to the operator at the station, and when they are asked. Other modules transmit them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

from inertial.counts import number_of
from pipelines.archive import Run
from pipelines.jobs.seating import disagreements
from pipelines.stages.figures import plain_reason
from pipelines.tables.frames import rows_of
from schemas.errors import OperatorNeeded

if TYPE_CHECKING:
    from pipelines.chain.runner import Done, Runner
    from pipelines.jobs.job import Job

Kind = Literal["load", "confirm", "trouble", "unload", "approve"]
Answer = Literal["go", "stop"]
JUDGED = "grade"  # after this stage each unit has its result: the operator unloads, then the report is made


@dataclass(frozen=True)
class Prompt:
    """An action of the operator that the run needs to continue.

    ``load``: seat the units. ``confirm``: the slots contradict the slot map. ``trouble``: correct a fault of the station;
    the run continues after its last record. ``unload``: remove the units, each slot with its result. ``approve``: additional
    station time.
    """

    kind: Kind
    run: str
    text: str
    slots: tuple[tuple[int, str], ...] = ()


class Operator(Protocol):
    """An operator who answers questions."""

    def ask(self, prompt: Prompt) -> Answer:
        """``go`` when the action is done, ``stop`` to stop the run."""
        ...


class Attendance:
    """A run with an operator, who is asked before the measurement, at a fault of the station, and after grading."""

    def __init__(self, operator: Operator, job: Job, run: str) -> None:
        self.operator, self.job, self.run = operator, job, run
        self._seated = False  # the units were measured here and are still in their slots

    def capture(self, runner: Runner, stage: Callable[[], Done]) -> Done:
        """Run the capture with the necessary questions."""
        records = runner.archive.capture(self.job.capture_id)
        if records.is_complete():
            return stage()
        if not records.finished():
            self._need("load", "seat the units as listed", lot=True)
        while wrong := seated_otherwise(self.job):  # until the slots agree with the slot map
            self._need("confirm", "; ".join(wrong) + "; seat the units as in the slot map")
        while True:
            try:
                done = stage()
            except OperatorNeeded as problem:
                self._need("trouble", problem.condition)
                continue
            self._seated = True
            return done

    def unload(self, run: Run) -> None:
        """Shows the result of each slot and asks to remove the units; nothing where they were not measured here."""
        if not self._seated:
            return
        self._seated = False
        results = {str(row["unit"]): _result(row) for row in rows_of(run.table("grades"))}
        passed = sum(text.startswith("pass") for text in results.values())
        text = f"{passed} of {number_of(len(results), 'unit')} passed; remove the units and sort them as listed"
        slots = tuple((u.slot, f"{u.serial}  {results.get(u.serial, 'no result')}") for u in self.job.lot.units)
        self._ask(Prompt("unload", self.run, text, slots))

    def _need(self, kind: Kind, text: str, *, lot: bool = False) -> None:
        slots = tuple((unit.slot, unit.serial) for unit in self.job.lot.units) if lot else ()
        self._ask(Prompt(kind, self.run, text, slots))

    def _ask(self, prompt: Prompt) -> None:
        if self.operator.ask(prompt) == "stop":
            message = f"run {self.run}: stopped at '{prompt.kind}' by the operator ({prompt.text})"
            raise OperatorNeeded(f"{message}; give the command again to continue")


def _result(row: dict[str, Any]) -> str:
    """The result of a unit: pass with its grade, or the reasons of fail or refusal."""
    grade = f", grade {row['grade']}" if row["outcome"] == "pass" and row["grade"] else ""
    why = f": {plain_reason(row['reasons'])}" if row["outcome"] != "pass" and row["reasons"] else ""
    return f"{row['outcome']}{grade}{why}"


def seated_otherwise(job: Job) -> list[str]:
    """Differences between the slots of a job's station and its lot."""
    from stations import open_station

    with open_station(job.station, job.lot) as station:
        return disagreements(station, job.lot)
