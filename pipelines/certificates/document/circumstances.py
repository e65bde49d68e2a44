"""Texts of a certificate on the circumstances: standards, traceability, method, conditions, omissions."""

from collections.abc import Iterator, Sequence
from typing import Any

from inertial.counts import number_of
from pipelines.archive import Run
from pipelines.certificates.document import content
from pipelines.certificates.document.laboratory import LaboratoryFile
from pipelines.certificates.entries import STATIC
from pipelines.certificates.stated_budget import StatedBudget
from pipelines.procedures import PROCEDURES
from pipelines.schedule.early_end import dwell_words, early_end, early_end_sentence
from pipelines.stages.uncertainty.contributions import left_out
from pipelines.stages.uncertainty.tables import LABELS
from pipelines.tables.prior import prior_document, prior_sentence
from schemas.reference import Reference
from schemas.stated import SYMBOLS
from schemas.uncertainty import Uncertainty

SOURCES = {
    "[stability], ": "stability of the device, ",
    "[stability]": "stability of the device",
    "[uncertainty]": "uncertainties of the references",
    "slot_rotation_mrad of the simulation": "simulation: rotation of the slots",
    "slot_gradient_K of the simulation": "simulation: gradient in the slots",
    "slot_lag_s of the simulation": "simulation: thermal lag of the slots",
    "supply_reading_ppm of the simulation": "simulation: measurement of the supply",
}


def source_words(text: str) -> str:
    """The source of a contribution as text, without names of tables and keys of files."""
    for table, words in SOURCES.items():
        text = text.replace(table, words)
    return text


def standard_of(reference: Reference) -> content.ReferenceStandard:
    """A standard of the station as a certificate names it."""
    accreditation = f" ({reference.accreditation})" if reference.accreditation else ""
    unit = SYMBOLS.get(reference.unit or "", "")
    return content.ReferenceStandard(
        laboratory=reference.laboratory + accreditation,
        date="" if reference.date is None else reference.date.isoformat(),
        due=reference.due.isoformat(),
        uncertainty="" if reference.U is None else f"U = {reference.U:g} {unit} (k = {reference.k:g})",
        **{name: getattr(reference, name) for name in ("id", "what", "certificate", "sha256")},
    )


def entries_of(run: Run, covers: str) -> dict[str, bool]:
    """The entries of [uncertainty] that the results use, and whether each names a standard (in all bands of an entry)."""
    terms = Uncertainty.model_validate(run.manifest("budget")["parameters"].get("uncertainty") or {})
    named: dict[str, bool] = {}
    roles = {STATIC if kind == STATIC else PROCEDURES[kind].roles[0] for kind in covers.split()}
    for path, entry in terms.every_entry.items():
        role, _, term = path.partition(".")
        if (role.partition("[")[0] if term else STATIC) in roles:
            name = f"{LABELS[term]} of the {role.partition('[')[0]}" if term else role
            named[name.replace("_", " ")] = named.get(name.replace("_", " "), True) and bool(entry.reference)
    return named


def traceability(budget: StatedBudget, entries: dict[str, bool]) -> str:
    """Statement of traceability; entries of the budget without a standard are listed with their source."""
    source = budget.grade_source.replace("_", " ")
    if not budget.references:
        return (
            "No reference standard with a certificate is stated for this calibration; metrological traceability to the SI is not "
            f"claimed. The uncertainties of the references are taken from: {source}."
        )
    traced, rest = ([name for name in sorted(entries) if entries[name] is is_traced] for is_traced in (True, False))
    text = (
        "Traceable to the SI through the calibration certificates of the standards listed: "
        f"{', '.join(traced) or 'no contribution names one of them'}."
    )
    if not rest:
        return text
    return f"{text} Without a standard of their own, by the sources in the budgets ({source}): {', '.join(rest)}."


def left_out_words(run: Run, held: Sequence[str]) -> str:
    """A text with the contributions that are not stated, which U counts as zero, and the misalignments that are not determined.

    Parameters
    ----------
    held : directions whose misalignment the poses do not determine
    """
    terms = run.manifest("budget")["parameters"].get("uncertainty") or {}
    names = left_out(Uncertainty.model_validate(terms))
    named = ", ".join(LABELS.get(name, name) for name in names)
    unstated = f"Not stated, and not contained in the uncertainties U: {named}." if names else ""
    unseen = f"Not determined by the poses, and taken for zero: misalignment along {', '.join(held)}." if held else ""
    return " ".join(filter(None, (unstated, unseen)))


def methods(
    run: Run, serial: str, recipe: dict[str, Any], who: LaboratoryFile, compared: Sequence[str], *, static: bool
) -> Iterator[str]:
    """Sentences on the laboratory's procedure, the static calibration, and the comparisons."""
    if who.method.procedure:
        yield f"{who.method.procedure}."
    if static:
        end = early_end(run)
        yield _static_method(run, recipe, "" if end is None else dwell_words(end))
        yield from _of_earlier_calibrations(run, serial)
        if end is not None and (sentence := early_end_sentence(end, serial)):
            yield f"Plan: {sentence.replace('_', ' ')}."
    yield from compared


def _static_method(run: Run, recipe: dict[str, Any], lengths: str) -> str:
    """The static calibration; ``lengths``: of its dwells, s, where the run may have chosen them."""
    dwells = run.table("dwells")
    kinds = dwells["kind"].astype(str)
    poses, checks = (dwells.loc[kinds == kind, "pose"].nunique() for kind in ("dwell", "verification"))
    verified = f"; verification in {checks} other poses" if checks else "; no pose was kept for verification"
    planned = len(recipe.get("temperatures_C") or [0])
    lengths = lengths or str(recipe.get("dwell_s", ""))  # none where the means of the dwells were imported
    soaks = number_of(int(dwells["soak"].nunique()) if "soak" in dwells else planned, "temperature")
    return (
        f"Static multi-position calibration in the gravity of the Earth: {poses} poses at "
        f"{soaks}, {f'{lengths} s per pose, ' if lengths else ''}recipe "
        f"'{recipe.get('name', '')}'; least-squares fit of {', '.join(recipe.get('effects', ())).replace('_', ' ')}{verified}."
    )


def _of_earlier_calibrations(run: Run, serial: str) -> Iterator[str]:
    """A sentence on the weight of earlier calibrations of the unit; none without a prior."""
    table = run.table("prior") if "prior" in run.tables() else None
    prior = None if table is None else prior_document(table[table["unit"] == serial], run.about)
    if prior is not None:
        yield f"Earlier calibrations: {prior_sentence(prior).replace('_', ' ')}."


def conditions_of(run: Run, serial: str, recipe: dict[str, Any], *, static: bool) -> list[content.Condition]:
    """Temperatures, supply and gravity of a unit's readings; of a static calibration those of its dwells."""
    table = run.table("dwells" if static else "readings")
    rows, conditions = table[table["unit"] == serial], []
    for column, name, unit in (
        ("unit_C", "temperature of the item", "°C"),
        ("chamber_C", "temperature of the chamber", "°C"),
        ("supply_V", "supply voltage", "V"),
    ):
        values = rows[column].dropna() if column in rows else []
        if len(values):
            conditions.append(content.Condition(name=name, low=float(min(values)), high=float(max(values)), unit=unit))
    gravity = recipe.get("local_gravity_m_s2") or (run.about.get("mapping") or {}).get("local_gravity_m_s2")
    if gravity and static:
        conditions.append(content.Condition(name="local gravity", low=float(gravity), high=float(gravity), unit="m/s²"))
    return conditions
