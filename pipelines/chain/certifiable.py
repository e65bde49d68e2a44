"""Whether a run may be certified: refusals of runs that are unsound, overdue, inadequate or without a stated budget."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from inertial.decisions import ADEQUATE_ABOVE
from inertial.probability import passes
from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS
from inertial.uncertainty.rounding import equal
from pipelines.archive import Archive, Run
from pipelines.certificates.entries import LedgerEntry
from pipelines.certificates.ledger import Ledger
from pipelines.certificates.measured import END, measured_span, same_measurement
from pipelines.integrity import verify
from pipelines.jobs.adequacy import adequacy_of
from pipelines.jobs.references import contradiction, references_of
from pipelines.stages.grade import BUDGET
from pipelines.stages.judge import AdequacyDocument, told_by
from pipelines.stages.uncertainty.budget_terms import BudgetTerms, archived_terms
from schemas.errors import ArchiveUnusable, WrongUse
from schemas.limits import ADEQUACY_P_MIN

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

NEEDED_OF_TABLE = ("gravity", "level", "orthogonality", "outer_offset", "inner_offset", "harmonics", "pose", "reader")
"""Entries of [uncertainty] without which nothing is certified that a table turned."""
NEEDED_OF_FACES = ("gravity", "level", "pose", "reader")
"""The same for an import whose units were put down on known faces: there are no encoders."""
NEEDED_OF_NORMS = ("gravity", "reader")
"""The same for an import of unknown orientations: the norm of gravity does not depend on the poses."""


def refuse_unsound(run: Run, keys: "Mapping[str, Ed25519PublicKey]") -> None:
    """Refuse a run that ``tumbleline verify RUN`` finds something wrong with: it would lend its findings a certificate.

    Parameters
    ----------
    keys : public keys that are trusted; where there are any, each file of the run must be signed by one.
    """
    findings = verify(Archive(run.archive.root), [run.id], keys=keys, demanded=bool(keys)).checked.findings
    if findings:
        more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        raise ArchiveUnusable(
            f"certify: {findings[0].path} {findings[0].message}{more}; not certified, see 'tumbleline verify {run.id}'"
        )


def refuse_meanwhile(ledger: Ledger, event: LedgerEntry, seen: int) -> None:
    """Refuse a calibration where another of the unit was written since the ledger was looked at.

    Parameters
    ----------
    seen : how many events the unit had then.
    """
    for other in ledger.calibrations(event.serial):
        if not event.ends_others_of(other.event):
            continue
        repeated = (other.run, other.start, other.until) == (event.run, event.start, event.until)
        if other.event.sequence > seen and not repeated and other.start < event.until and event.start < other.until:
            raise WrongUse(
                f"certify: unit {event.serial}: certificate {other.certificate} of run {other.run}, valid from {other.start} "
                f"until {other.until}, was written by {other.event.who} while this command was at work; nothing was certified: "
                f"look with 'tumbleline show {event.serial}', then give the command again if it is to take its place"
            )


def withdrawn(ledger: Ledger, run: Run, event: LedgerEntry) -> str:
    """Why a unit is not certified without a reason of its own, else empty: its last certificate of these data was revoked.

    Another analysis of data that were found wrong is as wrong; whether they were, or the model was, only the laboratory knows.
    """
    known = [earlier for earlier in ledger.calibrations(event.serial) if event.ends_others_of(earlier.event)]
    last = next((earlier for earlier in reversed(known) if same_measurement(run, earlier.run)), None)
    if last is None or not last.withdrawn or last.ended_by is None:
        return ""
    whose = "this run" if last.run == run.id else f"run {last.run}, which has the same measurements,"
    return (
        f"certificate {last.certificate} of {whose} was revoked on {last.ended_by.when[:10]} ({last.reason}); measure the unit "
        f"again, or, if its measurements are right, certify it with --units {event.serial} --reason TEXT"
    )


def overdue(station: Mapping[str, Any], day: str) -> str:
    """The first reference standard of a station that was due for calibration by a day, and what to do; empty if none was."""
    for standard in station.get("reference", []):
        if str(standard["due"]) <= day:
            return (
                f"reference standard {standard['id']} (certificate {standard['certificate']}) was due on {standard['due']}; have "
                "it calibrated, enter its new certificate in the station's file, and measure again"
            )
    return ""


def refuse_overdue(run: Run) -> None:
    """Refuse a run whose station had a reference standard that was due before it measured."""
    if late := overdue(run.about.get("station") or {}, _measured(run)):
        raise WrongUse(f"certify: run {run.id} was measured on {_measured(run)}, {late}")


def _measured(run: Run) -> str:
    return str(run.about.get("measured") or run.about["when"])[:10]


def refuse_inadequate(run: Run) -> str:
    """The verdict on a run's model for its certificate; refused are runs whose verdict their limits do not allow.

    Captured and imported runs are judged alike. At the 5 % of a verdict one good lot in twenty is not adequate by chance, so a
    p of at least ``adequacy_p_min`` of the limits passes. Where what is missing is found, it is not by chance: noise alone shows
    such a finding in one lot of a thousand. (A p that is drawn is never below 0.01, whatever the model lacks.)
    """
    judged = _verdict(run)
    if judged is None:
        return ""
    adequate, reason, p, named = judged["adequate"], judged["reason"], judged["p_value"], judged["named"]
    least = float((run.about.get("limits") or {}).get("adequacy_p_min") or ADEQUACY_P_MIN)
    see = f"see 'tumbleline diagnose {run.id}'"
    if adequate is None or p is None:
        raise WrongUse(
            f"certify: the model of run {run.id} cannot be judged ({reason}), an adequate one is needed; {see}"
        )
    if not adequate and named:
        raise WrongUse(
            f"certify: the model of run {run.id} is NOT ADEQUATE (p {equal(p)}), and what it lacks is found, a model with it is "
            f"needed; {see}"
        )
    if not passes(p, least):
        raise WrongUse(
            f"certify: the model of run {run.id} is NOT ADEQUATE (p {equal(p)}), p of at least {least:g} is needed "
            f"(adequacy_p_min of the limits); {see}"
        )
    if adequate:
        return f"ADEQUATE (p {equal(p)})"
    level = f"NOT ADEQUATE at the level of {100.0 * ADEQUATE_ABOVE:g} % (p {equal(p)})"
    return f"{level}; certified, as nothing is found that it lacks and p is at least {least:g}"


def _verdict(run: Run) -> AdequacyDocument | None:
    """The verdict on a run's model; an import without one is judged. None where there is nothing to judge."""
    verdict = adequacy_of(run)
    if verdict is not None:
        return verdict
    if run.about.get("capture") or "dwells" not in run.tables():
        return None
    from pipelines.diagnosis.diagnose import diagnose  # loads the search for effects, which captured runs do not need

    past = run.table("history") if "history" in run.tables() else None
    effects = list((run.about.get("recipe") or {}).get("effects", ()))
    dwells = run.table("dwells")
    return told_by(diagnose(dwells, past, effects or None), dwells["unit"].nunique())


REFUTED_BELOW = 0.001
"""p of the stated table below which nothing is certified; above it the certificate states the finding."""


def refuse_contradicted(run: Run) -> str:
    """The finding that the table is worse than stated, for the certificate; empty where there is none.

    Refused where chance does not explain it: a U from the stated references would be smaller than the run has shown.
    """
    judged = references_of(run)
    text = "" if judged is None else contradiction(judged)
    if judged is not None and text and not passes(judged["p_value"] or 0.0, REFUTED_BELOW):
        raise WrongUse(
            f"certify: run {run.id}: {text}; a U from the stated values would be too small, references that hold are needed; "
            "have the table examined, state in [uncertainty] at least what was found, and measure again"
        )
    return text


def refuse_unstated(run: Run) -> None:
    """Refuse a run whose figures rest on noise only, on assumed figures, or on no figure over the period of validity.

    A run that is made again from archived data keeps what its station stated when it measured: it states no more than before.
    """
    terms, grades = archived_terms(run.about), run.table("grades")
    if terms is None and not run.about.get("capture"):
        raise WrongUse(
            f"certify: run {run.id} was imported without a statement of its references (noise only), a certificate needs the "
            "whole budget; import the recording again with --references FILE, a TOML with [uncertainty] as in a station's file"
        )
    compares = bool(run.about.get("capture")) and run.table("coefficients").empty  # each comparison says what it needs
    based = "basis" in grades and set(grades["basis"]) == {BUDGET}
    if terms is None or terms.stated is None or not (based or compares):
        raise WrongUse(
            f"certify: run {run.id} states no uncertainty of its references (noise only), a certificate needs the whole budget; "
            "add [uncertainty] to the station's file and measure again"
        )
    if terms.stated.grade_source == "assumed":
        raise WrongUse(
            f'certify: run {run.id} rests on assumed uncertainties (grade_source = "assumed"), certificates or data sheets are '
            "needed; state where the figures of [uncertainty] come from and measure again"
        )
    if compares:
        return
    needed, again = _needed(run, terms)
    missing = {name: rules for name, rules in terms.stated.not_stated.items() if name.split()[0] in needed}
    if missing:
        listed = ", ".join(f"{name} (dominates {rules})" for name, rules in missing.items())
        raise WrongUse(
            f"certify: run {run.id}: not stated: {listed}; add it to [uncertainty] (a 0 needs exact = true) and {again}"
        )
    if not run.table("uncertainties")["quantity"].eq("bias_error_period").any():
        checks = "verification poses" if run.about.get("capture") else "dwells held out by --set verify=N"
        raise WrongUse(
            f"certify: run {run.id} has no error over the period of validity ({terms.certificate.validity_months} months): state "
            f"[stability] of the device with a horizon_days that reaches so far, and {checks}, and {again}"
        )


def _needed(run: Run, terms: BudgetTerms) -> tuple[tuple[str, ...], str]:
    """Entries of [uncertainty] that the run's results depend on, and what is to be done where one is missing."""
    captured, columns = bool(run.about.get("capture")), set(run.table("dwells").columns)
    again = "measure again" if captured else "import the recording again"
    needed: list[str] = list(NEEDED_OF_TABLE)
    if not captured and not set(ANGLE_COLUMNS) <= columns:
        needed = list(NEEDED_OF_FACES if set(FORCE_COLUMNS) <= columns else NEEDED_OF_NORMS)
    to_fixture = run.table("coefficients")["effect"].eq("misalignment").any()  # it is a result in either frame
    if "level" in needed and (to_fixture or terms.certificate.frame == "fixture"):
        needed.append("seat")
    if terms.stability is not None and terms.stability.ratiometric > 0.0:
        needed.append("supply")
    if not terms.reads_own_temperature:
        needed += ["thermometer", "gradient", *(["settling"] if captured else [])]
    elif terms.stated is not None and terms.stated.thermometer is None:
        needed.append("thermometer")
    return tuple(needed), again


def refuse_two_at_once(ledger: Ledger, run: Run, serial: str) -> None:
    """Refuse a unit that was measured somewhere else at the same time: two units have one serial."""
    span = measured_span(run)
    for calibration in ledger.calibrations(serial):
        other = Run(run.archive, calibration.run)
        if (
            other.id == run.id
            or not (other.path / END).is_file()
            or other.about.get("capture") == run.about.get("capture")
        ):
            continue
        other_span = measured_span(other)
        if span and other_span and span[0] < other_span[1] and other_span[0] < span[1]:
            raise WrongUse(
                f"certify: unit {serial} was measured in run {run.id} from {span[0]} to {span[1]} and in run {other.id} from "
                f"{other_span[0]} to {other_span[1]}: two units have one serial; find out which is which, and give one another"
            )
