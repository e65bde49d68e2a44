"""State of the units in the ledger on a day: valid, revoked and missing certificates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pipelines.archive.store import Place
from pipelines.audit.calibrations import date_of, day_of
from pipelines.certificates.ledger_index import histories_of
from pipelines.certificates.validity import Calibration, calibrations_of


class CertificateState(NamedTuple):
    """The state of a unit in the ledger on a day.

    certificate : the valid one, else the last one, even if it ended; state : its state on that day: ``valid``,
        ``ended``, ``revoked`` or ``later`` (it begins later)
    until : day since 1970 with which it ends or ended
    entered : whether the last measurement is certified, in any state
    """

    certificate: str
    state: str
    until: float
    entered: bool


@dataclass(frozen=True)
class Certificates:
    """The ledger at the end of a day.

    of : calibrations by kind of device and serial, in the order of certification
    captures : of runs; a re-run of a capture certifies the same measurement
    problems : units with a fault in the ledger, by their folder
    """

    day: str
    of: Mapping[tuple[str, str], Sequence[Calibration]]
    captures: Mapping[str, str]
    problems: Mapping[str, str]

    def __len__(self) -> int:
        """Number of calibrations."""
        return sum(len(own) for own in self.of.values())

    def standing(self, device: str, serial: str, run: str) -> CertificateState | None:
        """The state of a unit; None for a unit that was never certified.

        Parameters
        ----------
        run : the last run of the unit
        """
        known = self.of.get((device, serial), ())
        if not known:
            return None
        entered = any(self._measured(one.run) == self._measured(run) for one in known)
        held = next((one for one in known if one.holds(self.day)), None)
        if held is not None:
            return CertificateState(held.certificate, "valid", day_of(held.until), entered)
        last = known[-1]
        if last.state == "revoked":
            return CertificateState(last.certificate, "revoked", _end(last), entered)
        return CertificateState(
            last.certificate, "later" if last.start > self.day else "ended", day_of(last.until), entered
        )

    def _measured(self, run: str) -> str:
        """The capture of a run, or the run itself where it has none."""
        return self.captures.get(run) or run


def certificates_of(root: Place, until: float, captures: Mapping[str, str]) -> Certificates:
    """The ledger of an archive.

    Parameters
    ----------
    until : end of the last day whose events count
    captures : of runs, by their names
    """
    day = date_of(until - 1.0)
    histories = histories_of(root)
    of: dict[tuple[str, str], list[Calibration]] = {}
    for events in histories.units:
        known = calibrations_of(event for event in events if event.when[:10] <= day)
        for one in known:
            of.setdefault((one.event.device.upper(), one.serial), []).append(one)
    return Certificates(day, of, captures, histories.problems)


def _end(revoked: Calibration) -> float:
    """Day on which a revoked calibration ended; for one revoked from its first day the day of the revocation."""
    if revoked.until > revoked.start or revoked.ended_by is None:
        return day_of(revoked.until)
    return day_of(revoked.ended_by.when[:10])
