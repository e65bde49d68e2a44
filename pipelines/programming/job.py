"""The programming of the units of a run: choice of units and station, and their certificates."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from pipelines.archive import Archive, Run, files
from pipelines.archive.locks import alone
from pipelines.archive.signatures import public_keys
from pipelines.certificates import Ledger
from pipelines.certificates.days import today
from pipelines.certificates.entries import STATIC, WRITING
from pipelines.certificates.measured import measured_on, measured_span
from pipelines.certificates.programmed import TOP, add
from pipelines.certificates.validity import Calibration
from pipelines.chain.certify import certify
from pipelines.export import UnitCalibration, unit_calibrations
from pipelines.programming.outcome import Choice, ProgrammingOutcome
from pipelines.programming.process import Programmer
from schemas.errors import WrongUse
from schemas.lot import Lot
from schemas.recipe import Recipe
from schemas.station import StationConfig
from stations import open_station


def chosen_units(run: Run, serials: Sequence[str]) -> list[tuple[int, UnitCalibration]]:
    """Slots and calibrations of the units of a run that passed, or of those named; the rules of an export hold."""
    if not run.about.get("capture"):
        raise WrongUse(
            f"program: run {run.id} is an import, a run on a station is needed; measure the units on a station"
        )
    slots = {unit["serial"]: int(unit["slot"]) for unit in run.about["lot"]["units"]}
    once = tuple(dict.fromkeys(serials))  # a device that is named twice is written once
    calibrations = unit_calibrations(run, once, failed=False, revoked=True)
    allowed = [unit for unit in calibrations if unit.certificate is None or not unit.certificate.withdrawn]
    revoked = [unit for unit in calibrations if unit.certificate is not None and unit.certificate.withdrawn]
    if revoked and (serials or not allowed):
        raise WrongUse(
            f"program: unit {revoked[0].unit}: {revoked[0].certified}, a valid calibration is needed; measure the unit again"
        )
    return [(slots[unit.unit], unit) for unit in allowed]


def station_of(run: Run) -> StationConfig:
    """The station that measured a run."""
    return StationConfig.model_validate(run.about["station"])


def program_run(
    run: Run,
    units: Sequence[tuple[int, UnitCalibration]],
    config: StationConfig,
    choice: Choice,
    report: Callable[[str], None],
) -> tuple[list[ProgrammingOutcome], dict[str, str]]:
    """The outcome of each unit, and the renewed certificates by serial.

    The certificate of a unit ends before the first write to its device. A unit that was certified with these coefficients is
    certified again, to the same day, when its memory is verified.
    """
    root, ledger, day = run.archive.root, Ledger(run.archive.root), today()
    units = [(slot, unit.with_every_axis) for slot, unit in units]
    held: dict[str, Calibration | None] = {}

    def end_certificate(serial: str) -> int:
        held[serial] = _held(ledger, serial, run.id, day)
        if any(
            calibration.until > day and calibration.start < calibration.until
            for calibration in ledger.calibrations(serial)
        ):
            ledger.revoke(serial, WRITING, day=day)
        return len(ledger.events(serial)) + 1 if held[serial] is not None else 0

    choice = replace(choice, date=int(datetime.now(UTC).strftime("%Y%m%d")))
    with open_lot(run, config) as (station, saved), alone(root / TOP, wait=True):
        for _, unit in units:
            _refuse_older(ledger, run, unit.unit, day)
        recipe = Recipe.model_validate(run.about["recipe"])
        door = config.suspenders.door
        worker = Programmer(station, root, run.id, recipe, choice, door, end_certificate, report, saved)
        outcomes = worker.program(units)
    given: dict[str, str] = {}
    for outcome in outcomes:
        old = held.get(outcome.serial)
        if outcome.outcome == "proved" and old is not None:
            renewed = _renewed(ledger, run, outcome, day, old.stated_until)
            if renewed:
                given[outcome.serial] = renewed
    return outcomes, given


def _renewed(ledger: Ledger, run: Run, outcome: ProgrammingOutcome, day: str, until: str) -> str:
    """The certificate of a unit whose memory is verified; empty where it would not have the number that the device contains."""
    reason = f"written into the device, copy {outcome.copy.upper()}, sequence {outcome.document()['sequence']}"
    event = certify(ledger, run, [outcome.serial], day, until, reason=reason, keys=public_keys()).events[0]
    if event.sequence == outcome.certificate:
        return event.certificate
    ledger.revoke(outcome.serial, WRITING, day=day, certificate=event.sequence)
    outcome.outcome, outcome.step = "failed", "certify"
    outcome.reason = (
        f"the device contains certificate number {outcome.certificate}, and another process wrote to the ledger, so that its "
        f"number became {event.sequence}; repeat the command"
    )
    add(run.archive.root, outcome.serial, "failed", {"run": run.id, "reason": outcome.reason, **outcome.document()})
    return ""


def _refuse_older(ledger: Ledger, run: Run, serial: str, day: str) -> None:
    """Refuse coefficients that were not measured after those of another run that are certified for the unit today."""
    for calibration in ledger.calibrations(serial):
        if calibration.run == run.id or not calibration.holds(day) or STATIC not in calibration.event.covers.split():
            continue
        other = Run(run.archive, calibration.run)
        theirs, ours = _measured_at(other), _measured_at(run)
        same = bool(run.about.get("capture")) and other.about.get("capture") == run.about.get("capture")
        if same or theirs >= ours:
            raise WrongUse(
                f"program: unit {serial}: certificate {calibration.certificate} is of run {calibration.run}, measured {theirs}, "
                f"and run {run.id} was measured {ours}, not after it; write that run, or end its certificate with "
                f"'tumbleline certificate revoke {serial}'"
            )


def _measured_at(run: Run) -> str:
    """Time, or day where that alone is known, at which the measurement of a run ended."""
    span = measured_span(run)
    return span[1] if span else measured_on(run)


def _held(ledger: Ledger, serial: str, run: str, day: str) -> Calibration | None:
    """The calibration of this run that a unit has today, or had until a programming that was not completed.

    The last calibration of the run decides: an earlier one, which a writing ended, does not come back where the last was ended
    for another reason.
    """
    of_run = [
        calibration
        for calibration in ledger.calibrations(serial)
        if calibration.run == run and calibration.stated_until > day >= calibration.start
    ]
    last = of_run[-1] if of_run else None
    if last is None or last.holds(day):
        return last
    return last if last.ended_by is not None and last.ended_by.reason == WRITING else None


@contextmanager
def open_lot(run: Run, config: StationConfig) -> Generator[tuple[Any, Callable[[], None]]]:
    """The station, and a function that saves the state of a simulated one, from which the next programming continues."""
    lot = Lot.model_validate(run.about["lot"])
    root = run.archive.root
    path = root / TOP / "station" / f"{run.about['capture']}.bin"
    resume = None
    if config.kind == "simulated":
        resume = path.read_bytes() if path.is_file() else Archive(root).capture(run.about["capture"]).last_state()
    with open_station(config, lot, resume=resume, run=f"program {run.id}") as station:

        def saved() -> None:
            if config.kind == "simulated":
                files.publish(path, station.state())

        yield station, saved


def document(run: Run, outcomes: Sequence[ProgrammingOutcome], given: Mapping[str, str]) -> dict[str, Any]:
    """The result for JSON."""
    return {
        "run": run.id,
        "units": [{**outcome.document(), "certificate": given.get(outcome.serial)} for outcome in outcomes],
    }
