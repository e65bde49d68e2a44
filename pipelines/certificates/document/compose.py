"""The content of a certificate from the run, its stated budget, the ledger and the laboratory's file."""

from collections.abc import Sequence
from math import isfinite, nan
from typing import Any

from inertial.counts import number_of
from pipelines.archive import Run
from pipelines.certificates import Calibration
from pipelines.certificates.document import content
from pipelines.certificates.document.as_found import adjustment
from pipelines.certificates.document.content import CertificateContent, letters_of
from pipelines.certificates.document.laboratory import LaboratoryFile
from pipelines.certificates.document.numbers import probability, significant
from pipelines.certificates.ledger import stated
from pipelines.certificates.measured import measured_on, measured_span
from pipelines.certificates.stated_budget import Row, StatedBudget, edge, stated_budget
from pipelines.stages.figures import FIGURES
from pipelines.stages.uncertainty.contributions import left_out
from pipelines.stages.uncertainty.tables import LABELS, has_uncertainty
from pipelines.tables.calibration import EVERY_AXIS
from pipelines.tables.frames import rows_of
from pipelines.tables.prior import prior_document, prior_sentence
from schemas.decisions import BOUND, GRADES, LARGEST_ERROR, MEDIAN, exceedance
from schemas.errors import ArchiveUnusable, WrongUse
from schemas.reference import Reference
from schemas.uncertainty import Uncertainty
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
}
"""Words for the norm of gravity, of a device that has no three axes to measure it."""
BUDGETS = ("bias", "scale", "output", "bias_error_period")
"""Quantities whose budget a certificate prints."""
SOURCES = {
    "[stability], ": "stability of the device, ",
    "[stability]": "stability of the device",
    "[uncertainty]": "uncertainties of the references",
    "slot_rotation_mrad of the simulation": "simulation: rotation of the slots",
    "slot_gradient_K of the simulation": "simulation: gradient in the slots",
    "slot_lag_s of the simulation": "simulation: thermal lag of the slots",
    "supply_reading_ppm of the simulation": "simulation: measurement of the supply",
}
DECLARATION = (
    "The results relate only to the item calibrated, in the condition in which it was received, and to the stated conditions. "
    "This certificate may be reproduced in full only, unless the laboratory has approved otherwise in writing."
)
UNCERTAINTY = (
    "The reported expanded uncertainty U is the standard uncertainty multiplied by the coverage factor k that is stated beside "
    "it, for a coverage probability of about 95 %. It was evaluated by propagation through the fit (JCGM 100)."
)
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
        The run's coefficients are not those that were certified.
    """
    event, about, serial = calibration.event, run.about, calibration.serial
    _refuse(run, calibration)
    budget = stated_budget(run, serial)
    recipe, station = about.get("recipe") or {}, about.get("station") or {}
    own = [row for row in rows_of(run.table("coefficients")) if row["unit"] == serial]
    held = [row["name"] for row in own if (row["effect"], row["axis"]) == ("misalignment", EVERY_AXIS)]
    coefficients = [_coefficient(row) for row in own if row["effect"] != "misalignment" or row["axis"] != EVERY_AXIS]
    first, last = measured_span(run) or (measured_on(run), measured_on(run))
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
        method=_method(run, serial, recipe, who),
        norms=NORMS,
        frame=FRAMES.get(budget.frame, budget.frame),
        conditions=tuple(_conditions(run, serial, recipe)),
        references=tuple(_reference(one) for one in budget.references),
        traceability=_traceability(budget, {**(station.get("uncertainty") or {}), **(recipe.get("uncertainty") or {})}),
        results=tuple(_result(row, coefficients) for row, _ in budget.quantities if row["quantity"] != LARGEST_ERROR),
        budgets=tuple(_budget(row, parts) for row, parts in budget.quantities if row["quantity"] in BUDGETS),
        coefficients=tuple(coefficients),
        conformity=tuple(_conformity(row, letters_of(coefficients)) for row in budget.decisions),
        decision_rule="; ".join(dict.fromkeys(row["rule"] for row in budget.decisions)),
        limits=str((about.get("limits") or {}).get("name", "")),
        grade_statement=_grade_statement(budget, event.grade),
        adjustment=adjustment(run, calibration, known),
        amendment=_amendment(calibration, known),
        interval=f"As agreed with the customer, the next calibration is due on {calibration.stated_until}."
        if budget.customer_agreed
        else "",
        adequacy=event.adequacy,
        left_out=_left_out(run, held),
        uncertainty_note=UNCERTAINTY,
        declaration=DECLARATION,
        software=f"Tumbleline {(about.get('software') or {}).get('tumbleline', 'version not known')}",
        coefficients_sha256=event.coefficients,
    )


def _refuse(run: Run, one: Calibration) -> None:
    if one.state == "revoked" and one.ended_by is not None:
        raise WrongUse(
            f"certificate {one.certificate} of run {run.id} was revoked ({one.ended_by.reason}); no document is made of it, "
            "certify the unit again"
        )
    if run.manifest("coefficients")["sha256"] != one.event.coefficients:
        stated(run, [one.serial])  # says which hash is which
        raise ArchiveUnusable(
            f"certificate {one.certificate}: run {run.id} has other coefficients than were certified; restore the table "
            "from a copy"
        )


def _coefficient(row: Row) -> content.Coefficient:
    own = {name: row[name] for name in ("effect", "name", "axis", "value", "standard_error")}
    return content.Coefficient(**own, unit=row["unit_text"])


def _quantity(row: Row) -> str:
    return QUANTITIES.get(row["quantity"], str(row["quantity"]))


def _of_axes(text: str, letters: str) -> str:
    """A text that speaks of the norm of gravity, for a device with these axes."""
    for old, new in OF_FEWER_AXES.items() if len(letters) < len(AXES) else ():
        text = text.replace(old, new)
    return text


def _result(row: Row, coefficients: list[content.Coefficient]) -> content.Result:
    """A quantity of the budget; the scale, which the budget has relative to itself, as a sensitivity in units of the output."""
    value, unit, expanded = row["value"], row["unit_text"], row["expanded"]
    scale = [c for c in coefficients if c.effect == row["quantity"] == "scale" and c.axis == row["axis"]]
    if scale:
        value, unit, expanded = scale[0].value, scale[0].unit, abs(scale[0].value) * 1e-6 * expanded
    bare = row["quantity"] in {"output", "scale"} and not scale
    letters = letters_of(coefficients)
    return content.Result(
        quantity=_of_axes(_quantity(row), letters),
        axis=letters if row["axis"] == "norm" and len(letters) < len(AXES) else row["axis"],
        unit=unit,
        value=None if bare else value,
        expanded=expanded if has_uncertainty(row) else None,
        k=row["k"] if has_uncertainty(row) else None,
        dof=row["dof"] if isfinite(row["dof"]) else None,
    )


def _budget(row: Row, parts: list[Row]) -> content.BudgetTable:
    # contributions to the error over the period add up to the result, not to the result's own u
    deviation = not has_uncertainty(row)
    return content.BudgetTable(
        quantity=f"{_quantity(row)}, {row['axis']}",
        unit=row["unit_text"],
        u=row["value"] if deviation else row["u"],
        k=None if deviation else row["k"],
        expanded=None if deviation else row["expanded"],
        rows=tuple(
            content.Contribution(
                name=LABELS.get(one["contribution"], str(one["contribution"])),
                unit=row["unit_text"],
                source=_source(one["source"]),
                **{name: one[name] for name in ("type", "distribution", "u", "share")},
            )
            for one in sorted(parts, key=lambda one: -one["share"])
        ),
    )


def _source(text: str) -> str:
    """The source of a contribution without the names of tables and keys in files."""
    for table, words in SOURCES.items():
        text = text.replace(table, words)
    return text


def _conformity(row: Row, letters: str) -> content.Conformity:
    label = FIGURES[row["figure"]].label if row["figure"] in FIGURES else row["figure"]
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
    """What the grade says of the item: a probability, by the distribution of its largest error."""
    quantiles = {row["axis"]: row["value"] for row, _ in budget.quantities if row["quantity"] == LARGEST_ERROR}
    if not quantiles or grade not in GRADES:
        return ""
    risk = probability(exceedance(quantiles[MEDIAN], quantiles[BOUND], GRADES[grade]))
    return (
        f"Grade {grade}: in a use at the end of the stated period of {budget.validity_months} months, switched on anew, the "
        f"RMS error of the corrected output exceeds {GRADES[grade]:g} µg on any axis with a probability of {risk} (95 % bound of "
        f"the largest axis: {significant(quantiles[BOUND])} µg)."
    )


def _reference(one: Reference) -> content.ReferenceStandard:
    accreditation = f" ({one.accreditation})" if one.accreditation else ""
    return content.ReferenceStandard(
        laboratory=one.laboratory + accreditation,
        date="" if one.date is None else one.date.isoformat(),
        due=one.due.isoformat(),
        uncertainty="" if one.U is None else f"U = {one.U:g} {one.unit or ''} (k = {one.k:g})",
        **{name: getattr(one, name) for name in ("id", "what", "certificate", "sha256")},
    )


def _traceability(budget: StatedBudget, stated_entries: dict[str, Any]) -> str:
    """What is traceable and what is not: an entry of the budget that names no standard is said to rest on its source."""
    source = budget.grade_source.replace("_", " ")
    if not budget.references:
        return (
            "No reference standard with a certificate is stated for this calibration; metrological traceability to the SI is not "
            f"claimed. The uncertainties of the references are taken from: {source}."
        )
    own = {name: entry for name, entry in stated_entries.items() if isinstance(entry, dict)}
    traced = sorted(name for name, entry in own.items() if entry.get("reference"))
    rest = sorted(set(own) - set(traced))
    text = (
        "Traceable to the SI through the calibration certificates of the standards listed: "
        f"{', '.join(traced).replace('_', ' ') or 'no contribution names one of them'}."
    )
    if not rest:
        return text
    named = ", ".join(rest).replace("_", " ")
    return f"{text} Without a standard of their own, by the sources in the budgets ({source}): {named}."


def _left_out(run: Run, held: Sequence[str]) -> str:
    """The contributions that the statement of the references lacks: U counts them as zero; and what the poses do not show.

    Parameters
    ----------
    held : directions in which the poses do not show the response across
    """
    terms = run.manifest("budget")["parameters"].get("uncertainty") or {}
    names = left_out(Uncertainty.model_validate(terms))
    named = ", ".join(LABELS.get(name, name) for name in names)
    unstated = f"Not stated, and not contained in the uncertainties U: {named}." if names else ""
    unseen = f"Not determined by the poses, and taken for zero: misalignment along {', '.join(held)}." if held else ""
    return " ".join(filter(None, (unstated, unseen)))


def _method(run: Run, serial: str, recipe: dict[str, Any], who: LaboratoryFile) -> str:
    dwells = run.table("dwells")
    kinds = dwells["kind"].astype(str)
    poses, kept = (dwells.loc[kinds == kind, "pose"].nunique() for kind in ("dwell", "verification"))
    verified = f"; verification in {kept} other poses" if kept else "; no pose was kept for verification"
    soaks = number_of(len(recipe.get("temperatures_C") or [0]), "temperature")
    procedure = f"{who.method.procedure}. " if who.method.procedure else ""
    return (
        f"{procedure}Static multi-position calibration in the gravity of the Earth: {poses} poses at "
        f"{soaks}, {recipe.get('dwell_s', 'unknown')} s per pose, recipe "
        f"'{recipe.get('name', '')}'; least-squares fit of {', '.join(recipe.get('effects', ())).replace('_', ' ')}{verified}."
        f"{_prior(run, serial)}"
    )


def _prior(run: Run, serial: str) -> str:
    """What earlier calibrations add to those of a unit; empty without a prior."""
    table = run.table("prior") if "prior" in run.tables() else None
    prior = None if table is None else prior_document(table[table["unit"] == serial])
    return "" if prior is None else f" Earlier calibrations: {prior_sentence(prior).replace('_', ' ')}."


def _conditions(run: Run, serial: str, recipe: dict[str, Any]) -> list[content.Condition]:
    dwells = run.table("dwells")
    own, conditions = dwells[dwells["unit"] == serial], []
    for column, name, unit in (
        ("unit_C", "temperature of the item", "°C"),
        ("chamber_C", "temperature of the chamber", "°C"),
        ("supply_V", "supply voltage", "V"),
    ):
        values = own[column].dropna() if column in own else []
        if len(values):
            conditions.append(content.Condition(name=name, low=float(min(values)), high=float(max(values)), unit=unit))
    gravity = recipe.get("local_gravity_m_s2") or (run.about.get("mapping") or {}).get("local_gravity_m_s2")
    if gravity:
        conditions.append(content.Condition(name="local gravity", low=float(gravity), high=float(gravity), unit="m/s²"))
    return conditions


def _amendment(one: Calibration, known: list[Calibration]) -> content.Amendment:
    """A certificate of the same run that this one ended: its amendment; one that ended this one: where to look now."""
    ended = [old.certificate for old in known if old.event.sequence in one.event.ends and old.run == one.run]
    after = one.ended_by.certificate if one.ended_by is not None and one.ended_by.action != "revoke" else ""
    return content.Amendment(replaces=tuple(ended), reason=one.event.reason if ended else "", replaced_by=after)
