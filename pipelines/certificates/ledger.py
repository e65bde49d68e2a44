"""The ledger of calibrations: for each unit the events that begin and end their validity.

``calibrations/<aa>/<hash of the serial>/<sequence>.json``: a unit is found by reading one folder, whatever the number of units,
and no serial can lead to a path outside. Each event is a file that is created once. If two processes write the next event of a
unit, one of them fails, reads the other's event and decides again, so that every decision accounts for all earlier events.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from datetime import datetime, timedelta

from pipelines.archive import Archive, Run, files, hash_chain
from pipelines.archive.locks import alone
from pipelines.archive.provenance import provenance
from pipelines.archive.store import ObjectPath, Place
from pipelines.certificates.days import LAST, today
from pipelines.certificates.entries import LedgerEntry, event_of, folder_of, numbered_files
from pipelines.certificates.measured import same_measurement
from pipelines.certificates.refusals import nothing_to_revoke, refuse_other_device, refuse_serial
from pipelines.certificates.validity import Calibration, calibrations_of, overlapped
from schemas.errors import ArchiveUnusable, WrongUse

CLOCK_SLACK = timedelta(minutes=5)  # largest difference of the clocks of hosts that write into one archive


class Ledger:
    """The calibrations of an archive.

    Parameters
    ----------
    archive : the archive, or its root or address.
    """

    def __init__(self, archive: Archive | Place | str) -> None:
        self.root = (archive if isinstance(archive, Archive) else Archive(archive)).root

    def events(self, serial: str) -> list[LedgerEntry]:
        """The events of a unit's calibrations, in order; empty for an unknown unit."""
        return [event for event, _ in self._read(serial)]

    def calibrations(self, serial: str, known: str = "") -> list[Calibration]:
        """The unit's calibrations in the order in which they were certified.

        Parameters
        ----------
        known : only events up to this day; all where empty.
        """
        return calibrations_of(e for e in self.events(serial) if not known or e.when[:10] <= known)

    def valid_at(self, serial: str, day: str, known: str = "") -> Calibration | None:
        """The valid calibration of a unit on a day; None without one."""
        return next((calibration for calibration in self.calibrations(serial, known) if calibration.holds(day)), None)

    def all(self) -> Iterator[Calibration]:
        """Every calibration of every unit."""
        for events in self.histories():
            yield from calibrations_of(events)

    def histories(self) -> list[list[LedgerEntry]]:
        """The events of every unit, unit by unit in no particular order; files that were read before come from an index."""
        from pipelines.certificates.ledger_index import (
            histories_of,  # needs a table library; the look-up of one unit does not
        )

        histories = histories_of(self.root)
        for folder, problem in histories.problems.items():
            raise ArchiveUnusable(f"calibrations: {folder} {problem}")
        return histories.units

    def add(self, event: LedgerEntry, *, supersede: bool = False, amend: bool = True) -> tuple[LedgerEntry, bool]:
        """The event that certifies a calibration, and whether it existed before.

        Parameters
        ----------
        event : with serial, run, validity and evidence; the ledger adds the other values.
        supersede : also end calibrations that begin later and overlap.
        amend : whether it replaces a certificate of the same run that is valid on its first day; if not, that one is returned
        """
        refuse_serial(event.serial, "certify")
        event = replace(event, reason=event.reason.strip())
        there: list[LedgerEntry] = []

        def decided(events: Sequence[LedgerEntry]) -> LedgerEntry | None:
            known = calibrations_of(events)
            there[:] = [
                calibration.event
                for calibration in known
                if _same(calibration, event) or (not amend and _stands_for(calibration, event))
            ]
            if there:
                return None
            refuse_other_device(known, event)
            same_kind = [calibration for calibration in known if event.ends_others_of(calibration.event)]
            ends = overlapped(same_kind, event.start, event.until, supersede=supersede)
            return replace(event, action="supersede" if ends else "certify", ends=ends)

        written = self._append(event.serial, decided)
        return (there[-1], True) if written is None else (written, False)

    def revoke(self, serial: str, reason: str, *, day: str = "", certificate: int = 0) -> LedgerEntry:
        """The event that ends a unit's calibrations.

        Parameters
        ----------
        day : first day without validity; empty: the first day of the calibrations, so that they were never valid.
        certificate : sequence of the certificate; 0 for all that are valid today or later.
        """
        if not reason.strip():
            raise WrongUse("revoke: no reason is given, one is needed for the users of the calibration; add --reason")

        def decided(events: Sequence[LedgerEntry]) -> LedgerEntry:
            known = [calibration for calibration in calibrations_of(events) if calibration.start < calibration.until]
            chosen = [calibration for calibration in known if certificate in {0, calibration.event.sequence}]
            meant = [
                calibration for calibration in chosen if calibration.until > (day or ("" if certificate else today()))
            ]
            if not meant:
                hint = "" if events else Archive(self.root).units_like(serial)
                raise WrongUse(nothing_to_revoke(serial, known, certificate, day, hint))
            start = day or min(calibration.start for calibration in meant)
            ends = tuple(calibration.event.sequence for calibration in meant)
            last = meant[-1].event
            return replace(
                last, action="revoke", start=start, until=LAST, ends=ends, reason=reason.strip(), evidence=()
            )

        written = self._append(serial, decided)
        if written is None:  # a revocation always writes an event, or raises
            raise WrongUse(nothing_to_revoke(serial, [], certificate, day))
        self.anchor([written])
        return written

    def anchor(self, events: Sequence[LedgerEntry]) -> None:
        """Record events in the archive's hash chain, so that the removal of one is detected."""
        if events:
            paths = {self._name(event.serial, event.sequence): event for event in events}
            sealed = {path: files.sha256(self.root / path) for path in sorted(paths)}
            hash_chain.append(self.root, "calibrations", sealed, {**provenance(), "run": events[0].run})

    def unanchored(self, events: Sequence[LedgerEntry]) -> list[LedgerEntry]:
        """Those of some events that no entry of the chain has: their writer was killed."""
        known = hash_chain.sealed_names(self.root) if events else ()
        return [event for event in events if self._name(event.serial, event.sequence) not in known]

    def _append(self, serial: str, decide: Callable[[Sequence[LedgerEntry]], LedgerEntry | None]) -> LedgerEntry | None:
        """Decide on the events of a unit and write the result as its next event; None where nothing is written."""
        folder = self._folder(serial)
        with alone(folder, wait=True) if isinstance(folder, ObjectPath) else nullcontext():
            while True:
                known = self._read(serial)
                event = decide([event for event, _ in known])
                if event is None:
                    return None
                event = _stamped(event, known)
                data = files.manifest_bytes(event.document())
                if files.publish_first(self.root / self._name(serial, event.sequence), data):
                    return event

    def _folder(self, serial: str) -> Place:
        return self.root / folder_of(serial)

    @staticmethod
    def _name(serial: str, sequence: int) -> str:
        return f"{folder_of(serial)}/{sequence:06d}.json"

    def _read(self, serial: str) -> list[tuple[LedgerEntry, str]]:
        events = _events(self._folder(serial))
        for event, _ in events:
            if event.serial != serial:
                where = self._folder(serial)
                raise ArchiveUnusable(
                    f"calibrations: {where} holds unit {event.serial!r}, {serial!r} is needed; restore it from a copy"
                )
        return events


def _events(folder: Place) -> list[tuple[LedgerEntry, str]]:
    """Events of a unit's folder with the hashes of their files; refuses a gap in their numbers."""
    events: list[tuple[LedgerEntry, str]] = []
    for count, path in enumerate(numbered_files(folder), 1):
        data = path.read_bytes()
        event = event_of(files.parsed(data, path), str(path))
        if event.sequence != count or path.name != f"{count:06d}.json":
            raise ArchiveUnusable(
                f"calibrations: {folder} has event {path.name} where number {count} is needed; restore the missing file from a "
                "copy"
            )
        events.append((event, hashlib.sha256(data).hexdigest()))
    return events


def _stamped(event: LedgerEntry, known: Sequence[tuple[LedgerEntry, str]]) -> LedgerEntry:
    """The event with its number, the hash of the previous event, and author, host and time."""
    by = provenance()
    if known:
        last = known[-1][0]
        if datetime.fromisoformat(by["when"]) < datetime.fromisoformat(last.when) - CLOCK_SLACK:
            raise ArchiveUnusable(
                f"calibrations: the clock says {by['when']}, the last event of unit {event.serial} was written at {last.when}; "
                "set this host's clock, then give the command again (nothing was written)"
            )
    stamp = {key: by[key] for key in ("who", "where", "when")}
    return replace(event, sequence=len(known) + 1, previous=known[-1][1] if known else "", **stamp)


def _same(calibration: Calibration, event: LedgerEntry) -> bool:
    """Whether an event would certify a valid calibration again, and states no other reason, which would amend it."""
    old = (calibration.run, calibration.event.coefficients, calibration.start, calibration.until)
    repeated = old == (event.run, event.coefficients, event.start, event.until)
    return repeated and event.reason in {"", calibration.event.reason}


def _stands_for(calibration: Calibration, event: LedgerEntry) -> bool:
    """Whether a calibration of the same run and the same subjects is valid on the first day of the event."""
    old = (calibration.run, calibration.event.coefficients, calibration.event.covers)
    return old == (event.run, event.coefficients, event.covers) and calibration.holds(event.start)


def left_valid(archive: Archive, serial: str, ended: Sequence[int]) -> list[str]:
    """Numbers of the unit's certificates that hold today or later, of the measurements of others that were ended."""
    known = {calibration.event.sequence: calibration for calibration in Ledger(archive).calibrations(serial)}
    runs = [Run(archive, run) for run in dict.fromkeys(known[number].run for number in ended)]
    return [
        calibration.certificate
        for calibration in known.values()
        if calibration.until > max(calibration.start, today())
        and any(same_measurement(run, calibration.run) for run in runs)
    ]


def stated(run: Run, serials: Iterable[str]) -> dict[str, Calibration]:
    """The calibrations that certify a run, by serial: for each unit the valid one, else the last.

    Raises
    ------
    ArchiveUnusable
        A certificate is for other coefficients than those of the run; a revoked one is not checked.
    """
    ledger, out = Ledger(run.archive.root), dict[str, Calibration]()
    for serial in serials:
        of_run = [calibration for calibration in ledger.calibrations(serial) if calibration.run == run.id]
        if not of_run:
            continue
        chosen = out[serial] = next((calibration for calibration in of_run if calibration.state == "valid"), of_run[-1])
        present = run.manifest("coefficients")["sha256"]
        if chosen.state != "revoked" and present != chosen.event.coefficients:
            raise ArchiveUnusable(
                f"certificate {chosen.certificate} is for other coefficients than those of run {run.id}: their hash is "
                f"{present[:12]}…, that in the certificate {chosen.event.coefficients[:12]}…; restore the table from a copy, or "
                f"find the changes with 'tumbleline rerun {run.id} --check' and certify the run again"
            )
    return out
