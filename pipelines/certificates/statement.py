"""The statement on a unit's certificate in exports and reports."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from pipelines.archive import Run
from pipelines.certificates.days import today
from pipelines.certificates.ledger import Ledger
from pipelines.certificates.validity import Calibration
from schemas.errors import ArchiveUnusable


class Stated(NamedTuple):
    """The certificate of a unit for a run.

    start, until : first day, and the day after the last
    state : ``valid``, ``superseded`` or ``revoked``, independent of the date; reason : reason of its end
    """

    certificate: str
    start: str
    until: str
    state: str
    reason: str

    def holds(self, day: str) -> bool:
        """Whether it is valid on a day."""
        return self.start <= day < self.until

    def sentence(self) -> str:
        """The statement in one line, independent of the present date."""
        if self.state == "revoked":
            return f"certificate {self.certificate} REVOKED ({self.reason})"
        ended = "" if self.state == "valid" else f", {self.state} {self.reason}"
        return f"certificate {self.certificate}, valid from {self.start} until {self.until}{ended}"

    def document(self) -> dict[str, Any]:
        """The statement for JSON, with its validity today."""
        return {
            "certificate": self.certificate,
            "from": self.start,
            "until": self.until,
            "state": self.state,
            "reason": self.reason,
            "valid_now": self.holds(today()),
        }


def stated(run: Run, serials: Iterable[str]) -> dict[str, Stated]:
    """The certificates of the units of a run by serial: for each unit the one that is not ended, else the last.

    Raises
    ------
    ArchiveUnusable
        A certificate is for other coefficients than those of the run.
    """
    ledger, out = Ledger(run.archive.root), dict[str, Stated]()
    for serial in serials:
        own = [one for one in ledger.calibrations(serial) if one.run == run.id]
        if own:
            chosen = next((one for one in own if one.state == "valid"), own[-1])
            _refuse_other_coefficients(run, chosen)
            out[serial] = _stated(chosen)
    return out


def _refuse_other_coefficients(run: Run, one: Calibration) -> None:
    """Refuse a certificate for other coefficients; a revoked one is not checked."""
    present = run.manifest("coefficients")["sha256"]
    if one.state != "revoked" and present != one.event.coefficients:
        raise ArchiveUnusable(
            f"certificate {one.certificate} is for other coefficients than those of run {run.id}: their hash is "
            f"{present[:12]}…, that in the certificate {one.event.coefficients[:12]}…; restore the table from a copy, or "
            f"find the changes with 'tumbleline rerun {run.id} --check' and certify the run again"
        )


def _stated(one: Calibration) -> Stated:
    reason = one.ended_by.reason or f"by {one.ended_by.certificate}" if one.ended_by is not None else ""
    return Stated(one.certificate, one.start, one.until, one.state, reason)
