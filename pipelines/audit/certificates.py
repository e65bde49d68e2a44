"""What the ledger says of the units on a day: which certificate holds, which was revoked, what was never certified."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from pipelines.audit.calibrations import date_of, day_of
from pipelines.certificates.ledger_index import histories_of
from pipelines.certificates.validity import calibrations_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pipelines.archive.store import Place
    from pipelines.certificates.validity import Calibration


class CertificateState(NamedTuple):
    """How a unit stands in the ledger on a day.

    certificate : the one that holds, else the one certified last, even if it ended; state : of it, on that day: ``valid``,
        ``ended``, ``revoked`` or ``later`` (it begins later)
    until : day since 1970 with which it ends or ended
    entered : whether what was measured last is certified, in whatever state
    """

    certificate: str
    state: str
    until: float
    entered: bool


@dataclass(frozen=True)
class Certificates:
    """The ledger as it was known at the end of a day.

    of : calibrations by kind of device and serial, in the order in which they were certified
    captures : of runs; a run again of a capture certifies the same measurement
    problems : units of which the ledger cannot tell, by their folder
    """

    day: str
    of: Mapping[tuple[str, str], Sequence[Calibration]]
    captures: Mapping[str, str]
    problems: Mapping[str, str]

    def __len__(self) -> int:
        """Number of calibrations."""
        return sum(len(own) for own in self.of.values())

    def standing(self, device: str, serial: str, run: str) -> CertificateState | None:
        """How a unit stands; None where nothing of it was ever certified.

        Parameters
        ----------
        run : in which the unit was measured last
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
    until : end of the day up to which is known what was written
    captures : of runs, by their names
    """
    day = date_of(until - 1.0)
    found = histories_of(root)
    of: dict[tuple[str, str], list[Calibration]] = {}
    for events in found.units:
        known = calibrations_of(event for event in events if event.when[:10] <= day)
        for one in known:
            of.setdefault((one.event.device.upper(), one.serial), []).append(one)
    return Certificates(day, of, captures, found.problems)


def _end(revoked: Calibration) -> float:
    """When a revoked calibration ended; one that was revoked from its first day, when that was written."""
    if revoked.until > revoked.start or revoked.ended_by is None:
        return day_of(revoked.until)
    return day_of(revoked.ended_by.when[:10])
