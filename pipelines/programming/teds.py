"""The writing of TEDS into the memories of devices: archive, write page by page, read back before and after a power cycle."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipelines.archive import Run
from pipelines.export import ExportSettings, UnitCalibration, export_files
from pipelines.export.teds import DataSheet
from pipelines.programming.job import open_lot
from pipelines.programming.supply import power_cycle, require_safe
from schemas.errors import OperatorNeeded, StationError, StationRefused
from schemas.station import StationConfig
from stations.devices.teds_memory import PAGE, TedsMemory


@dataclass
class TedsOutcome:
    """The outcome of writing the TEDS of one device.

    pages : by axis, in the order of the memory · before : the whole memory before the first write
    """

    unit: str
    slot: int
    pages: Mapping[str, bytes]
    memory: TedsMemory
    before: bytes = b""
    step: str = ""
    reason: str = ""
    outcome: str = field(default="begun")

    @property
    def content(self) -> bytes:
        """The pages as the memory holds them."""
        return b"".join(self.pages.values())

    def document(self) -> dict[str, Any]:
        """The outcome for JSON."""
        pages = [
            {"axis": axis, "page": number, "content": page.hex()}
            for number, (axis, page) in enumerate(self.pages.items())
        ]
        return {
            "unit": self.unit, "outcome": self.outcome, "step": self.step, "reason": self.reason, "pages": pages,
            "before": self.before.hex(),
        }  # fmt: skip


def pages_of(unit: UnitCalibration, run: str, sheet: DataSheet) -> dict[str, bytes]:
    """The page of each axis of a unit, as ``export --format teds`` writes it; refused as that is."""
    files = export_files("teds", [unit], run, ExportSettings(data_sheet=sheet))
    named = {
        name.rpartition("-")[2].removesuffix(".teds"): page for name, page in files.items() if name.endswith(".teds")
    }
    return {letter: named[letter] for letter in unit.letters}


def program_teds(
    run: Run,
    units: Sequence[tuple[int, UnitCalibration]],
    config: StationConfig,
    sheet: DataSheet,
    report: Callable[[str], None],
) -> list[TedsOutcome]:
    """Writes TEDS into units (slot, calibration); a unit that fails does not stop the others.

    Coefficients and certificates stay as they are: the pages state the certificate's sensitivity, they do not apply it.
    """
    pages = {unit.unit: pages_of(unit, run.id, sheet) for _, unit in units}  # all are refused before any is written
    with open_lot(run, config) as (station, saved):
        slots = station.reader.slots
        outcomes = [TedsOutcome(unit.unit, slot, pages[unit.unit], slots[slot].teds()) for slot, unit in units]
        require_safe(station, config.suspenders.door)
        if station.reader.sampling() == "running":
            station.reader.stop()
        for outcome in outcomes:
            outcome.memory.require()
            if not slots[outcome.slot].holds(outcome.unit):
                raise OperatorNeeded(
                    f"slot {outcome.slot}: unit {outcome.unit} is not in it; seat the unit, or correct the lot"
                )
        for step, act in (("archive the memory", _archive), ("write", _write), ("read back", _read_back)):
            _each(outcomes, step, act, report)
            saved()
        if any(outcome.outcome == "begun" for outcome in outcomes):
            report("power cycle")
            power_cycle(station, config.suspenders.door)
        _each(outcomes, "read back after the power cycle", _read_back, report)
        saved()
    for outcome in outcomes:
        outcome.outcome = "proved" if outcome.outcome == "begun" else outcome.outcome
    return outcomes


def _each(
    outcomes: Sequence[TedsOutcome], step: str, act: Callable[[TedsOutcome], None], report: Callable[[str], None]
) -> None:
    for outcome in outcomes:
        if outcome.outcome != "begun":
            continue
        report(f"{outcome.unit}: {step}")
        try:
            act(outcome)
        except StationError as problem:
            outcome.outcome, outcome.step, outcome.reason = "failed", step, str(problem)


def _archive(outcome: TedsOutcome) -> None:
    outcome.before = outcome.memory.read()


def _write(outcome: TedsOutcome) -> None:
    for number, page in enumerate(outcome.pages.values()):
        outcome.memory.write_page(number, page)


def _read_back(outcome: TedsOutcome) -> None:
    """Refuses a memory whose pages differ from what was written, or whose sums are not 0 modulo 256."""
    found = outcome.memory.read()[: len(outcome.content)]
    wrong = [k for k, (a, b) in enumerate(zip(found, outcome.content, strict=True)) if a != b]
    sums = [sum(found[k : k + PAGE]) % 256 for k in range(0, len(found), PAGE)]
    if wrong or any(sums):
        where = f"differs from byte {wrong[0]} on" if wrong else f"has page sums {sums}"
        raise StationRefused(
            f"{outcome.memory.name}: the memory {where}, the written pages are needed; replace the memory"
        )
