"""Certifying a run: its units that passed get a validity in the ledger; those that did not are listed with the reason."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from pipelines.archive import Run, files
from pipelines.archive.locks import alone
from pipelines.archive.signatures import public_keys
from pipelines.certificates.comparisons import TABLES, Comparisons
from pipelines.certificates.days import day_of, months_after, today
from pipelines.certificates.entries import FOLDER, STATIC, LedgerEntry
from pipelines.certificates.ledger import Ledger
from pipelines.certificates.programmed import refuse_unproved, unproved
from pipelines.certificates.refusals import allowed_months, refuse_period
from pipelines.chain.certifiable import (
    refuse_contradicted,
    refuse_inadequate,
    refuse_meanwhile,
    refuse_overdue,
    refuse_two_at_once,
    refuse_unsound,
    refuse_unstated,
    withdrawn,
)
from pipelines.stages.figures import plain_reason
from pipelines.tables.frames import rows_of
from schemas.errors import ArchiveUnusable, WrongUse, did_you_mean

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

EVIDENCE = ("dwells", "coefficients", "covariance", "grades")


NOTHING = "nothing to certify: its recipe has neither multi_position nor sweep, random_vibration, transverse or shock; add one"
IMPORTED = "imported"
"""The station of a calibration whose measurements came from elsewhere."""


@dataclass
class Certified:
    """The result of the certification of the units of a run.

    written : the events that certify, new in the ledger
    there : events that were in it already
    left_out : why a unit was not certified, by serial
    """

    written: list[LedgerEntry] = field(default_factory=list[LedgerEntry])
    there: list[LedgerEntry] = field(default_factory=list[LedgerEntry])
    left_out: dict[str, str] = field(default_factory=dict[str, str])

    @property
    def events(self) -> list[LedgerEntry]:
        """All that certify."""
        return [*self.written, *self.there]


def certify(  # noqa: PLR0913 - each is an option of the command
    ledger: Ledger,
    run: Run,
    units: Sequence[str] = (),
    start: str = "",
    until: str = "",
    *,
    months: int = 0,
    reason: str = "",
    supersede: bool = False,
    keys: "Mapping[str, Ed25519PublicKey] | None" = None,
) -> Certified:
    """The events that certify units of a run, written to the ledger.

    Parameters
    ----------
    units : serials; every unit of the run that passed where empty.
    start : first day, today where empty.
    until : day after the last, so many ``months`` after the first where empty, as many as are allowed where that is 0.
    reason : kept with the events; units whose certificate of these data was revoked are certified again only by name, with one
    supersede : end calibrations that begin later and overlap, too.
    keys : trusted public keys; that of the configured private key where None. Where there are keys, one must have signed the run.

    Raises
    ------
    ArchiveUnusable
        The run is not as it was written, or not signed by a key that is trusted.
    WrongUse
        The dates are not allowed, a unit may not be certified, or another process certified one of the units meanwhile.
    """
    first = day_of(start, "--since") if start else today()
    last = day_of(until, "--until") if until else months_after(first, months or allowed_months(run))
    if first >= last:
        raise WrongUse(
            f"certify: valid from {first} until {last}, a day after the first is needed; correct --since or --until"
        )
    meant = bool(start or until or months or reason.strip() or supersede)  # the bare command again is no amendment
    proposals, result = _proposals(run, units, first, last, reason)
    seen = {proposal.serial: len(ledger.events(proposal.serial)) for proposal in proposals}
    refuse_unsound(run, public_keys() if keys is None else keys)
    refuse_period(run, first, last)
    # one at a time from here on: of two who certify one serial at the same moment the second is refused, and learns of the first
    with alone(ledger.root / FOLDER, wait=True):
        if not (units and reason.strip()):
            result.left_out |= {
                proposal.serial: why for proposal in proposals if (why := withdrawn(ledger, run, proposal))
            }
            proposals = [proposal for proposal in proposals if proposal.serial not in result.left_out]
            if units and result.left_out:
                serial, why = next(iter(result.left_out.items()))
                raise WrongUse(f"certify: unit {serial} of run {run.id}: {why}")
        for proposal in proposals:
            refuse_two_at_once(ledger, run, proposal.serial)
            if not supersede:
                refuse_meanwhile(ledger, proposal, seen[proposal.serial])
        try:
            for proposal in proposals:
                event, was_there = ledger.add(proposal, supersede=supersede, amend=meant)
                (result.there if was_there else result.written).append(event)
            ledger.anchor([*result.written, *ledger.unanchored(result.there)])
        except ArchiveUnusable as problem:  # a disk that became full
            entered = f"units in the ledger: {len(result.events)} of {len(proposals)}"
            raise ArchiveUnusable(f"{problem}; {entered}; give the same command again to go on") from None
    return result


def offered(ledger: Ledger, run: Run) -> bool:
    """Whether :func:`certify` would give a unit of a finished run a certificate from today on, signatures apart."""
    first = today()
    try:
        refuse_period(run, first, last := months_after(first, allowed_months(run)))
        return any(not withdrawn(ledger, run, proposal) for proposal in _proposals(run, (), first, last, "")[0])
    except WrongUse:
        return False


def _proposals(
    run: Run, units: Sequence[str], first: str, last: str, reason: str
) -> tuple[list[LedgerEntry], Certified]:
    """The events to be written, and the units left out with the reason; a named unit that may not be certified is refused."""
    grades = {str(row["unit"]): row for row in rows_of(_grades(run))}
    refuse_overdue(run)
    adequacy = refuse_inadequate(run)
    refuse_unstated(run)
    static = not run.table("coefficients").empty
    comparisons = Comparisons(run)
    if contradicted := refuse_contradicted(run):
        adequacy += f"{'; ' if adequacy else ''}{contradicted}"
    about, result = run.about, Certified()
    named = (*EVIDENCE, *(TABLES if comparisons.parts else ()))
    evidence = tuple(sorted((name, files.sha256(run.path / f"{name}.json")) for name in named))
    station = (about.get("station") or {}).get("name", IMPORTED)
    shared: dict[str, Any] = {
        "device": about["lot"]["device"], "run": run.id, "start": first, "until": last, "station": station,
        "recipe": about["recipe"]["name"], "coefficients": "", "reason": reason, "evidence": evidence,
        # the ledger has still to number and stamp the event
        "sequence": 0, "action": "certify", "ends": (), "who": "", "where": "", "when": "", "previous": "",
    }  # fmt: skip
    proposals: list[LedgerEntry] = []
    for serial in units or tuple(grades):
        if serial not in grades:
            raise WrongUse(f"certify: no unit {serial!r} in run {run.id}; {did_you_mean(serial, grades)}")
        row, compared = grades[serial], comparisons.results(serial)
        why = _why_not(run, serial, row, named=bool(units))
        if not (why or static or compared):
            why = "; ".join(comparisons.reasons(serial).values()) or NOTHING
            if units:
                raise WrongUse(f"certify: unit {serial} of run {run.id}: {why}")
        if why:
            result.left_out[serial] = why
            continue
        kinds = [str(comparisons.parts[number].kind) for number in compared]
        covers: list[str] = list(dict.fromkeys([STATIC, *kinds] if static else kinds))
        verdicts = "; ".join(filter(None, (adequacy, comparisons.verdicts(serial))))
        grade, words = str(row["grade"]), " ".join(covers)
        event = LedgerEntry(serial=serial, grade=grade, covers=words, adequacy=verdicts, **shared)
        proposals.append(replace(event, coefficients=run.manifest(event.table)["sha256"]))
    if not (proposals or static) and not any(row["outcome"] != "pass" for row in grades.values()):
        raise WrongUse(f"certify: run {run.id}: {next(iter(result.left_out.values()), NOTHING)}")
    return proposals, result


def _why_not(run: Run, serial: str, row: Mapping[str, Any], *, named: bool) -> str:
    """Why a unit is not certified by its grade or its memory, empty where it may be; one that is named is refused."""
    half = unproved(run.archive.root, serial)
    if half and named:
        refuse_unproved(run.archive.root, serial)
    if half or row["outcome"] == "pass":
        return half
    why = f"{row['outcome']}: {plain_reason(str(row['reasons']))}"
    if named:
        raise WrongUse(f"certify: unit {serial} of run {run.id} did not pass ({why}); only what passed is certified")
    return why


def _grades(run: Run) -> Any:
    if "grades" not in run.tables():
        raise WrongUse(f"certify: run {run.id} has no grades, they are needed; {_how_to_grade(run)}")
    run.table("coefficients")  # refuses one that was changed since it was graded
    return run.table("grades")


def _how_to_grade(run: Run) -> str:
    if run.about.get("capture"):
        return "it is not finished: give its 'tumbleline run' again and it goes on"
    if axis := run.about.get("plane_across"):
        return f"it was turned about {axis} alone, the scale of {axis} is not known: measure other orientations"
    if "dwells" not in (tables := run.tables()) and "procedure_findings" in tables:
        return (
            "a dynamic test was imported, and its file states neither the uncertainty of the reference sensor nor limits: "
            "measure it with 'tumbleline run', by a recipe with limits, on a station whose file has [uncertainty]"
        )
    again = f"'tumbleline fit {run.id} --limits FILE'"
    return f"it was imported: fit it against limits with {again} and certify the run that this makes"
