"""The content of a certificate from the run, its stated budget, the ledger and the laboratory's file."""

from math import isfinite, nan

from pipelines.archive import Run
from pipelines.certificates import Calibration
from pipelines.certificates.document import content
from pipelines.certificates.document.as_found import adjustment
from pipelines.certificates.document.circumstances import (
    conditions_of,
    entries_of,
    left_out_words,
    methods,
    source_words,
    standard_of,
    traceability,
)
from pipelines.certificates.document.compared import compared_content
from pipelines.certificates.document.content import CertificateContent, letters_of
from pipelines.certificates.document.laboratory import LaboratoryFile
from pipelines.certificates.document.numbers import probability, significant
from pipelines.certificates.entries import STATIC
from pipelines.certificates.ledger import certified_table, refuse_changed
from pipelines.certificates.measured import measured_on, measured_span, same_measurement
from pipelines.certificates.stated_budget import Row, StatedBudget, edge, stated_budget
from pipelines.procedures import FIGURES as OF_PROCEDURES
from pipelines.stages.figures import FIGURES
from pipelines.stages.uncertainty.tables import LABELS, has_uncertainty
from pipelines.tables.calibration import EVERY_AXIS
from pipelines.tables.frames import rows_of
from schemas.decisions import BOUND, GRADES, LARGEST_ERROR, MEDIAN, exceedance
from schemas.errors import WrongUse
from schemas.units import AXES

QUANTITIES = {
    "bias": "bias at the reference temperature",
    "scale": "sensitivity at the reference temperature",
    "misalignment": "misalignment to the fixture",
    "orthogonality": "deviation from orthogonality",
    "bias_temperature": "temperature coefficient of bias",
    "scale_temperature": "temperature coefficient of sensitivity",
    "output": "corrected output, anywhere in the certified range",
    "bias_error": "error of the corrected output, verification (RMS)",
    "verification_norm": "error of the norm of gravity, verification (largest of the poses)",
    "bias_error_period": "error of the corrected output to be expected over the stated period (standard deviation)",
}
OF_FEWER_AXES = {
    QUANTITIES["verification_norm"]: "error of the corrected output, verification (largest of the poses)",
    "error of |a|": "error",
}
"""Replacements for "norm of gravity" in texts on a device with fewer than three axes, which cannot measure it."""
BUDGETS = ("bias", "scale", "output", "bias_error_period")
"""Quantities whose budget a certificate prints."""
DECLARATION = (
    "The results relate only to the item calibrated, in the condition in which it was received, and to the stated conditions. "
    "This certificate may be reproduced in full only, unless the laboratory has approved otherwise in writing."
)
UNCERTAINTY = (
    "The reported expanded uncertainty U is the standard uncertainty multiplied by the coverage factor k that is stated beside "
    "it, for a coverage probability of about 95 %. "
)
FITTED = "It was evaluated by propagation through the fit (JCGM 100)."
COMPARED = "It was evaluated from the contributions of the budgets (JCGM 100)."
NOT_ADJUSTED = content.Adjustment(
    earlier="", earlier_date="", text="a comparison with a reference sensor adjusts nothing"
)
FRAME_OF_COMPARISONS = "axes of the item, named beside each result"
NORMS = ("JCGM 100:2008", "JCGM 106:2012")
FRAMES = {
    "intrinsic": "axes of the sensor; a rotation of the whole unit in its mount is not part of the result",
    "fixture": "axes of the fixture",
}


def compose(run: Run, calibration: Calibration, known: list[Calibration], who: LaboratoryFile) -> CertificateContent:
    """The content of the certificate of a calibration.

    Parameters
    ----------
    known : calibrations of the unit in the ledger, in order; who : the laboratory's file.

    Raises
    ------
    WrongUse
        The calibration was revoked, its run states no uncertainty, or an archive of an earlier version lacks what is needed.
    ArchiveUnusable
        The run's table is not the one that was certified.
    """
    event, about, serial = calibration.event, run.about, calibration.serial
    _refuse(run, calibration)
    budget = stated_budget(run, serial)
    recipe, station = about.get("recipe") or {}, about.get("station") or {}
    rows = [row for row in rows_of(run.table("coefficients")) if row["unit"] == serial]
    held = [row["name"] for row in rows if (row["effect"], row["axis"]) == ("misalignment", EVERY_AXIS)]
    coefficients = [_coefficient(row) for row in rows if row["effect"] != "misalignment" or row["axis"] != EVERY_AXIS]
    first, last = measured_span(run) or (measured_on(run), measured_on(run))
    static = STATIC in event.covers.split()
    compared = compared_content(run, serial, [row for row, _ in budget.quantities])
    fitted = [(row, parts) for row, parts in budget.quantities if "." not in row["quantity"]]
    words = compared.budgets | {name: QUANTITIES[name] for name in BUDGETS}
    return CertificateContent(
        number=calibration.certificate,
        issued=event.when[:10],
        serial=serial,
        device=event.device,
        grade=event.grade,
        run=run.id,
        measured_from=first[:10],
        measured_to=last[:10],
        simulated=station.get("kind") == "simulated",
        who=who,
        method=" ".join(methods(run, serial, recipe, who, compared.methods, static=static)),
        norms=NORMS,
        frame=FRAMES.get(budget.frame, budget.frame) if static else FRAME_OF_COMPARISONS,
        conditions=(*conditions_of(run, serial, recipe, static=static), *compared.conditions),
        references=tuple(standard_of(reference) for reference in budget.references),
        traceability=traceability(budget, entries_of(run, event.covers)),
        results=(
            *(_result(row, coefficients) for row, _ in fitted if row["quantity"] != LARGEST_ERROR),
            *compared.results,
        ),
        responses=tuple(compared.responses),
        budgets=tuple(
            _budget(row, parts, words[row["quantity"]]) for row, parts in budget.quantities if row["quantity"] in words
        ),
        coefficients=tuple(coefficients),
        conformity=tuple(_conformity(row, letters_of(coefficients)) for row in budget.decisions),
        decision_rule="; ".join(dict.fromkeys(row["rule"] for row in budget.decisions)),
        limits=str((about.get("limits") or {}).get("name", "")),
        grade_statement=_grade_statement(budget, event.grade),
        adjustment=adjustment(run, calibration, known) if static else NOT_ADJUSTED,
        amendment=_amendment(run, calibration, known),
        interval=f"As agreed with the customer, the next calibration is due on {calibration.stated_until}."
        if budget.customer_agreed
        else "",
        adequacy=event.adequacy,
        left_out=" ".join([*([left_out_words(run, held)] if static else []), *compared.left_out]).strip(),
        uncertainty_note=UNCERTAINTY + (FITTED if static else COMPARED),
        declaration=DECLARATION,
        software=f"Tumbleline {(about.get('software') or {}).get('tumbleline', 'version not known')}",
        certified_table=certified_table(run, event),
        certified_sha256=event.coefficients,
    )


def _refuse(run: Run, calibration: Calibration) -> None:
    if calibration.state == "revoked" and calibration.ended_by is not None:
        raise WrongUse(
            f"certificate {calibration.certificate} of run {run.id} was revoked ({calibration.ended_by.reason}); no document "
            "is made of it; measure the unit again"
        )
    refuse_changed(run, calibration)
    run.refuse_edited()


def _coefficient(row: Row) -> content.Coefficient:
    values = {name: row[name] for name in ("effect", "name", "axis", "value", "standard_error")}
    return content.Coefficient(**values, unit=row["unit_text"])


def _of_axes(text: str, letters: str) -> str:
    """A text about the norm of gravity, adapted to a device with these axes."""
    for old, new in OF_FEWER_AXES.items() if len(letters) < len(AXES) else ():
        text = text.replace(old, new)
    return text


def _result(row: Row, coefficients: list[content.Coefficient]) -> content.Result:
    """A result from a quantity of the budget; the scale, relative in the budget, as a sensitivity in units of the output."""
    value, unit, expanded = row["value"], row["unit_text"], row["expanded"]
    scale = [c for c in coefficients if c.effect == row["quantity"] == "scale" and c.axis == row["axis"]]
    if scale:
        value, unit, expanded = scale[0].value, scale[0].unit, abs(scale[0].value) * 1e-6 * expanded
    bare = row["quantity"] in {"output", "scale"} and not scale
    letters = letters_of(coefficients)
    return content.Result(
        quantity=_of_axes(QUANTITIES.get(row["quantity"], str(row["quantity"])), letters),
        axis=letters if row["axis"] == "norm" and len(letters) < len(AXES) else row["axis"],
        unit=unit,
        value=None if bare else value,
        expanded=expanded if has_uncertainty(row) else None,
        k=row["k"] if has_uncertainty(row) else None,
        dof=row["dof"] if isfinite(row["dof"]) else None,
    )


def _budget(row: Row, parts: list[Row], words: str) -> content.BudgetTable:
    # contributions to the error over the period add up to the result, not to the result's own u
    deviation = not has_uncertainty(row)
    return content.BudgetTable(
        quantity=f"{words}, {row['axis']}",
        unit=row["unit_text"],
        u=row["value"] if deviation else row["u"],
        k=None if deviation else row["k"],
        expanded=None if deviation else row["expanded"],
        rows=tuple(
            content.Contribution(
                name=LABELS.get(contribution["contribution"], str(contribution["contribution"])),
                unit=row["unit_text"],
                source=source_words(contribution["source"]),
                **{name: contribution[name] for name in ("type", "distribution", "u", "share")},
            )
            for contribution in sorted(parts, key=lambda part: -part["share"])
        ),
    )


def _conformity(row: Row, letters: str) -> content.Conformity:
    name = str(row["figure"])
    label = FIGURES[name].label if name in FIGURES else OF_PROCEDURES[name].meaning if name in OF_PROCEDURES else name
    label = _of_axes(label, letters)
    least = isfinite(row.get("least", nan))
    return content.Conformity(
        figure=f"{label} (least value, accepted from)" if least else label,
        expanded=row["uncertainty"],
        limit=edge(row),
        unit=row["unit_text"],
        **{name: row[name] for name in ("value", "accept", "outcome", "pfa")},
    )


def _grade_statement(budget: StatedBudget, grade: str) -> str:
    """Meaning of the grade as a probability, by the distribution of the largest error; empty without a grade."""
    quantiles = {row["axis"]: row["value"] for row, _ in budget.quantities if row["quantity"] == LARGEST_ERROR}
    if not quantiles or grade not in GRADES:
        return ""
    risk = probability(exceedance(quantiles[MEDIAN], quantiles[BOUND], GRADES[grade]))
    return (
        f"Grade {grade}: in a use at the end of the stated period of {budget.validity_months} months, switched on anew, the "
        f"RMS error of the corrected output exceeds {GRADES[grade]:g} µg on any axis with a probability of {risk} (95 % bound of "
        f"the largest axis: {significant(quantiles[BOUND])} µg)."
    )


def _amendment(run: Run, calibration: Calibration, known: list[Calibration]) -> content.Amendment:
    """The amendment: the certificate of the same measurement that this one replaces, and the one that replaced this one."""
    event, last = calibration.event, calibration.ended_by
    earlier = [old for old in known if old.event.sequence < event.sequence and same_measurement(run, old.run)]
    ended = [old.certificate for old in earlier if old.event.sequence in event.ends]
    same_kind = [old for old in earlier if event.ends_others_of(old.event)][-1:]
    ended = ended or [old.certificate for old in same_kind if old.withdrawn and event.reason]
    after = last.certificate if last is not None and last.action != "revoke" else ""
    return content.Amendment(replaces=tuple(ended), reason=event.reason if ended else "", replaced_by=after)
