"""The person at the station: what is asked of them, and when. Who carries the question is another module's business."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

from pipelines.jobs.seating import disagreements
from schemas.errors import OperatorNeeded

if TYPE_CHECKING:
    from collections.abc import Callable

    from pipelines.chain.runner import Done, Runner
    from pipelines.jobs.job import Job

Kind = Literal["load", "confirm", "trouble", "unload", "approve"]
Answer = Literal["go", "stop"]


@dataclass(frozen=True)
class Prompt:
    """Something that a person has to do before the run goes on.

    ``load``: seat the units. ``confirm``: the slots say something else than the slot map. ``trouble``: the station needs a hand;
    the run goes on after its last record. ``unload``: take the units out. ``approve``: station time beyond what was asked for.
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
    """A run with somebody beside it: asked before the lot is measured, when the station needs a hand, and after it."""

    def __init__(self, operator: Operator, job: Job, run: str) -> None:
        self.operator, self.job, self.run = operator, job, run

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
            self._need("unload", "take the units out", lot=True)
            return done

    def _confirm(self) -> None:
        """Asks until the slots say what the slot map says."""
        while wrong := seated_otherwise(self.job):
            self._need("confirm", "; ".join(wrong) + "; seat them as the slot map says")

    def _need(self, kind: Kind, text: str, *, lot: bool = False) -> None:
        slots = tuple((unit.slot, unit.serial) for unit in self.job.lot.units) if lot else ()
        if self.operator.ask(Prompt(kind, self.run, text, slots)) == "stop":
            raise OperatorNeeded(
                f"run {self.run}: stopped at '{kind}' by the operator ({text}); give the command again to go on"
            )


def seated_otherwise(job: Job) -> list[str]:
    """What the slots of a job's station say against its lot."""
    from stations import open_station

    with open_station(job.station, job.lot) as station:
        return disagreements(station, job.lot)
