"""Periods of validity of the calibrations of a unit: a pure function of its events in the order of writing.

A new calibration ends those of the same subject (coefficients, sensitivity over frequency, shocks) that are valid on its first
day, so that a unit never has two valid calibrations of one subject on one day.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Any, Literal

from pipelines.certificates.days import today
from pipelines.certificates.documents import CalibrationDocument
from pipelines.certificates.entries import WRITING, LedgerEntry
from schemas.errors import WrongUse


@dataclass(frozen=True)
class Calibration:
    """A calibration of a unit with its period of validity.

    Parameters
    ----------
    start, until : first day, and the day after the last; equal where no day is left.
    stated_until : the end as certified.
    ended_by : the event that ended it earlier; None without one.
    """

    event: LedgerEntry
    until: str
    ended_by: LedgerEntry | None = None

    @property
    def serial(self) -> str:
        """The unit."""
        return self.event.serial

    @property
    def certificate(self) -> str:
        """Number of its certificate."""
        return self.event.certificate

    @property
    def run(self) -> str:
        """The run of the calibration."""
        return self.event.run

    @property
    def start(self) -> str:
        """First day."""
        return self.event.start

    @property
    def stated_until(self) -> str:
        """The day after the last as it was certified."""
        return self.event.until

    @property
    def stated_days(self) -> int:
        """Its length as it was certified."""
        return (date.fromisoformat(self.stated_until) - date.fromisoformat(self.start)).days

    @property
    def state(self) -> Literal["valid", "superseded", "revoked"]:
        """``valid``, ``superseded`` or ``revoked``: its state, independent of the date."""
        if self.ended_by is None:
            return "valid"
        return "revoked" if self.ended_by.action == "revoke" else "superseded"

    @property
    def withdrawn(self) -> bool:
        """Whether it was revoked, and not only while its coefficients were written into the device."""
        return self.state == "revoked" and self.reason != WRITING

    @property
    def reason(self) -> str:
        """Why it ended earlier than certified: the reason of the event, else its certificate; empty where it did not."""
        return "" if self.ended_by is None else self.ended_by.reason or f"by {self.ended_by.certificate}"

    def holds(self, day: str) -> bool:
        """Whether it is valid on a day."""
        return self.start <= day < self.until

    def state_on(self, day: str) -> str:
        """Its state on a day as text: ``valid``, ``begins later``, ``expired``, or how it ended prematurely."""
        if self.holds(day):
            return "valid"
        if self.state == "revoked":
            return f"revoked: {self.reason}"
        if day < self.start:
            return "begins later"
        return "expired" if self.state == "valid" else f"superseded {self.reason}"

    def key_values(self) -> list[str]:
        """Values for exports and reports: certificate, first day, the day after the last, state, reason of its end."""
        return [self.certificate, self.start, self.until, self.state, self.reason]

    def sentence(self) -> str:
        """The statement of exports and reports in one line, independent of the present date."""
        if self.state == "revoked":
            return f"certificate {self.certificate} REVOKED ({self.reason})"
        ended = "" if self.state == "valid" else f", {self.state} {self.reason}"
        return f"certificate {self.certificate}, valid from {self.start} until {self.until}{ended}"

    def statement(self) -> dict[str, Any]:
        """The statement of exports for JSON, with its validity today."""
        keys = ("certificate", "from", "until", "state", "reason")
        return {**dict(zip(keys, self.key_values(), strict=True)), "valid_now": self.holds(today())}

    def document(self) -> CalibrationDocument:
        """The calibration for JSON."""
        event = self.event
        ended = self.ended_by
        return {
            "certificate": self.certificate,
            "serial": self.serial,
            "device": event.device,
            "from": self.start,
            "until": self.until,
            "state": self.state,
            "stated_until": self.stated_until,
            "run": self.run,
            "covers": event.covers,
            "grade": event.grade,
            "station": event.station,
            "recipe": event.recipe,
            "coefficients": event.coefficients,
            "certified": {"who": event.who, "where": event.where, "when": event.when, "reason": event.reason},
            "ended": None
            if ended is None
            else {"action": ended.action, "sequence": ended.sequence, "who": ended.who, "when": ended.when,
                  "reason": ended.reason},
        }  # fmt: skip


def calibrations_of(events: Iterable[LedgerEntry]) -> list[Calibration]:
    """The calibrations of a unit from its events, in the order of certification."""
    by_sequence: dict[int, Calibration] = {}
    for event in events:
        for sequence in event.ends:
            old = by_sequence[sequence]
            if event.start < old.until:
                by_sequence[sequence] = replace(old, until=max(old.start, event.start), ended_by=event)
        if event.action != "revoke":
            by_sequence[event.sequence] = Calibration(event, event.until)
    return list(by_sequence.values())


def overlapped(known: Sequence[Calibration], start: str, until: str, *, supersede: bool) -> tuple[int, ...]:
    """Sequences of the calibrations that a new one from ``start`` to ``until`` ends.

    Earlier calibrations end where the new one begins. Calibrations that begin later are ended only with ``supersede``, because
    otherwise a calibration entered afterwards would silently replace a newer one.
    """
    clash = [old for old in known if old.start < old.until and old.start < until and start < old.until]
    later = [old for old in clash if old.start > start]
    if later and not supersede:
        first = later[0]
        raise WrongUse(
            f"certify: unit {first.serial}: {start} to {until} overlaps calibration {first.certificate} of run {first.run}, "
            f"valid from {first.start} to {first.until}, and begins before it; choose other dates, or end that calibration "
            "with --supersede"
        )
    return tuple(old.event.sequence for old in clash)
