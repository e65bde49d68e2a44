"""Texts and tables on the pages of a certificate, with the numbers rounded."""

import math
from typing import Any

from pipelines.certificates.document.content import Adjustment, CertificateContent, Contribution, Response
from pipelines.certificates.document.numbers import probability, rounded, significant, with_uncertainty
from schemas.decisions import digits_beside

SMALLEST_SHARE = 5e-4  # of a row of a budget: less is printed as 0.0 %

OF_OUTPUT = " Of the corrected output the uncertainty alone is stated."
PREVAILS = (
    "The same results are attached to this file as certificate.xml (Digital Calibration Certificate 3.0.0). The attached XML "
    "holds the results with all digits; where the two differ, this printed form prevails."
)


def page_content(c: CertificateContent) -> dict[str, Any]:
    """The content of the template ``certificate.typ``."""
    return {
        "number": c.number,
        "issued": c.issued,
        "issued_date": [int(part) for part in c.issued.split("-")],
        "laboratory": {"name": c.who.laboratory.name},
        "signatory": c.who.signatory.model_dump(),
        "footer": f"{c.who.laboratory.address} · {c.who.laboratory.email}",
        "notices": _notices(c),
        "head": _head(c),
        "parts": [part for part in _parts(c) if part],
    }


def _notices(c: CertificateContent) -> list[str]:
    notices: list[str] = []
    if c.simulated:
        notices.append("SIMULATED. The station that these results come from is a simulation: no device was measured.")
    if c.amendment.replaced_by:
        notices.append(f"This certificate was replaced by certificate {c.amendment.replaced_by}.")
    if c.amendment.replaces:
        changed = c.amendment.reason or "reason not stated"
        notices.append(
            f"This certificate amends and replaces certificate {', '.join(c.amendment.replaces)}. Change: {changed}"
        )
    return notices


def _head(c: CertificateContent) -> list[list[Any]]:
    who, item = c.who, c.who.item
    accreditation = who.laboratory.accreditation
    period = " to ".join(dict.fromkeys((c.measured_from, c.measured_to)))
    rows: list[list[Any]] = [
        ["Certificate number", c.number, True],
        ["Laboratory", f"{who.laboratory.name}\n{who.laboratory.address}\n{who.laboratory.email}"],
        ["Accreditation", "" if accreditation is None else f"{accreditation.number} ({accreditation.body})"],
        ["Customer", f"{who.customer.name}\n{who.customer.address}\n{who.customer.email}"],
        ["Customer's order", who.customer.order],
        ["Item calibrated", f"{item.description}, {item.manufacturer}, {item.model or c.device}"],
        ["Serial number", c.serial, True],
        ["Condition of the item", item.condition],
        ["Date of receipt", "" if item.received is None else item.received.isoformat()],
        ["Date of calibration", period],
        ["Place of calibration", PLACES[who.laboratory.place]],
        ["Date of issue", c.issued],
    ]
    return [row for row in rows if row[1]]


PLACES = {
    "laboratory": "the laboratory named above", "customer": "premises of the customer",
    "laboratoryBranch": "branch of the laboratory", "customerBranch": "branch of the customer",
    "other": "elsewhere, see the remarks",
}  # fmt: skip


def _table(
    title: str, heads: list[str], rows: list[list[str]], widths: list[Any], numeric: list[int]
) -> dict[str, Any]:
    return {"title": title, "heads": heads, "rows": rows, "widths": widths, "numeric": numeric}


def _parts(c: CertificateContent) -> list[dict[str, Any]]:
    remarks = [text for text in (c.who.method.remarks, c.interval) if text]
    deviations = c.who.method.deviations or "none stated"
    return [
        {"title": "Method", "before": [c.method], "facts": [["Evaluated by", ", ".join(c.norms)], ["Deviations", deviations],
         *([["Model of the fit", c.adequacy]] if c.adequacy else []),
         ["Software", c.software], ["Record", f"run {c.run}"]]},
        {"title": "Conditions", "facts": [
            [condition.name.capitalize(), _span(condition.low, condition.high, condition.unit)] for condition in c.conditions]},
        _references(c),
        _as_found(c.adjustment),
        _results(c),
        *(_response(response) for response in c.responses),
        _conformity(c),
        _budgets(c),
        _coefficients(c),
        {"title": "Remarks", "before": remarks} if remarks else {},
        {"title": "Statements", "before": [c.declaration, PREVAILS], "facts": [[
         f"SHA-256 of the table of {c.certified_table.replace('_', ' ')}", c.certified_sha256, True]]},
    ]  # fmt: skip


def _span(low: float, high: float, unit: str) -> str:
    places = {"m/s²": 5, "V": 3}.get(unit, 1)
    first, last = rounded(low, places), rounded(high, places)
    return f"{first} {unit}" if first == last else f"{first} to {last} {unit}"


def _references(c: CertificateContent) -> dict[str, Any]:
    rows = [
        [
            reference.id,
            reference.what,
            reference.certificate,
            reference.laboratory,
            reference.date or "not stated",
            reference.due,
            reference.uncertainty,
        ]
        for reference in c.references
    ]
    heads = ["standard", "quantity", "certificate", "laboratory", "date", "due", "uncertainty"]
    tables = [_table("", heads, rows, [2, 2, 2, 3, "auto", "auto", 2], [])] if rows else []
    return {"title": "Reference standards and traceability", "tables": tables, "before": [c.traceability]}


def _as_found(a: Adjustment) -> dict[str, Any]:
    if a.found_rms_ug is None or a.found_max_ug is None or a.left_rms_ug is None or a.left_max_ug is None:
        earlier = f"Earlier certificate {a.earlier} of {a.earlier_date}: " if a.earlier else ""
        text = a.text if earlier else f"{a.text[:1].upper()}{a.text[1:]}"
        return {"title": "As found, as left", "before": [f"{earlier}{text}."]}
    rows = [
        ["as found, coefficients of the earlier certificate", significant(a.found_rms_ug), significant(a.found_max_ug)],
        ["as left, coefficients of this certificate", significant(a.left_rms_ug), significant(a.left_max_ug)],
    ]
    heads = ["state", "RMS error of |a|, µg", "largest error of |a|, µg"]
    text = f"{a.text[:1].upper()}{a.text[1:]}; {a.dwells} readings."
    table = _table("", heads, rows, [1, "auto", "auto"], [1, 2])
    earlier = [["Earlier certificate", a.earlier, True], ["Date of it", a.earlier_date]]
    return {"title": "As found, as left", "before": [text], "facts": earlier, "tables": [table]}


def _results(c: CertificateContent) -> dict[str, Any]:
    rows: list[list[str]] = []
    for result in c.results:
        if result.expanded is None or result.k is None:
            rows.append([result.quantity, result.axis, significant(result.value or 0.0), "", result.unit, ""])
            continue
        value, expanded = with_uncertainty(result.value, result.expanded)
        rows.append([result.quantity, result.axis, value, expanded, result.unit, f"{result.k:.2f}"])
    heads = ["quantity", "axis", "value", "U", "unit", "k"]
    table = _table("", heads, rows, [1, "auto", "auto", "auto", "auto", "auto"], [2, 3, 5])
    after = [
        c.uncertainty_note,
        *([c.left_out] if c.left_out else []),
        f"Frame: {c.frame}. 1 g = 9.80665 m/s².{OF_OUTPUT if c.coefficients else ''}",
    ]
    return {"title": "Results", "tables": [table], "after": after}  # fmt: skip


def _response(response: Response) -> dict[str, Any]:
    """Sensitivity over frequency, and the curve through it."""
    rows = [
        [significant(p.frequency_hz, 5), significant(p.level_g), *with_uncertainty(p.magnitude, p.magnitude_expanded),
         significant(100.0 * p.magnitude_expanded / p.magnitude, 2), *with_uncertainty(p.phase_deg, p.phase_expanded),
         f"{max(p.magnitude_k, p.phase_k):.2f}"]
        for p in response.points
    ]  # fmt: skip
    heads = ["Hz", "amplitude, g", f"sensitivity, {response.unit}", "U", "U, %", "phase, °", "U, °", "k"]
    tables = [_table("", heads, rows, ["auto"] * 8, list(range(8)))]
    after: list[str] = []
    if (curve := response.curve) is not None:
        rows = [
            [p.name.replace("_", " "), *with_uncertainty(p.value, p.expanded), p.unit, f"{p.k:.2f}"]
            for p in curve.parameters
        ]
        tables.append(_table("Curve", ["parameter", "value", "U", "unit", "k"], rows, [1, *["auto"] * 4], [1, 2, 4]))
        after.append(
            f"The curve {curve.model.replace('_', ' ')} is {curve.verdict} (p = {curve.p_value:.2g}) and holds from "
            f"{significant(curve.low_hz)} to {significant(curve.high_hz)} Hz; the covariance of its parameters is in the "
            "attached XML. Outside this band, and as properties of the item, its parameters are not certified."
        )
    return {"title": response.title, "tables": tables, "after": after}


def _conformity(c: CertificateContent) -> dict[str, Any]:
    if not c.conformity:
        return {"title": "Conformity", "before": ["No statement of conformity is made."]}
    rows = []
    for decision in c.conformity:
        size = abs(decision.value)
        printed = (significant(size), "") if decision.expanded <= 0.0 else with_uncertainty(size, decision.expanded)
        edges = [
            significant(e, digits_beside(e, decision.limit, d)) for e, d in ((decision.limit, 3), (decision.accept, 4))
        ]
        told = max(printed[0], significant(size, digits_beside(size, decision.limit, 1)), key=len)
        rows.append(
            [decision.figure, told, printed[1], *edges, decision.unit, decision.outcome, probability(decision.pfa)]
        )
    heads = ["figure", "magnitude", "U", "limit", "accepted up to", "unit", "decision", "PFA"]
    table = _table("", heads, rows, [1, *["auto"] * 7], [1, 2, 3, 4, 7])
    passed = all(decision.outcome == "pass" for decision in c.conformity)
    verdict = "meets" if passed else "does not meet in every figure"
    grade = "" if c.grade == "none" else f" (grade {c.grade})"
    before = [
        f"The item {verdict} the specification '{c.limits}'{grade} in the figures listed.",
        *([c.grade_statement] if c.grade_statement else []),
        f"Decision rule: {c.decision_rule}. PFA: specific probability of false acceptance (JCGM 106, 7.4).",
    ]
    return {"title": "Conformity", "before": before, "tables": [table]}  # fmt: skip


def _folded(rows: tuple[Contribution, ...]) -> list[Contribution]:
    """The rows of a budget, those that would be printed with a share of 0.0 % as one row."""
    small = [row for row in rows if row.share < SMALLEST_SHARE]
    if len(small) < 2:
        return list(rows)
    others = Contribution(
        name=f"{len(small)} others, each below {100.0 * SMALLEST_SHARE:g} %",
        type="",
        distribution="",
        u=math.hypot(*(row.u for row in small)),
        unit=small[0].unit,
        share=sum(row.share for row in small),
        source=", ".join(row.name for row in small),
    )
    return [*(row for row in rows if row.share >= SMALLEST_SHARE), others]


def _budgets(c: CertificateContent) -> dict[str, Any]:
    """The budgets of all results in one table: each result, then its contributions."""
    rows: list[list[str]] = []
    for budget in c.budgets:
        u, share, coverage = significant(budget.u, 2), "", ""
        if budget.k is not None and budget.expanded is not None:
            u, share = significant(budget.u), "100 %"
            coverage = f"k = {budget.k:.2f}, U = {significant(budget.expanded, 2)} {budget.unit}"
        rows.append([budget.quantity, "", "", f"{u} {budget.unit}", share, coverage])
        rows += [
            [
                f"– {row.name.replace('_', ' ')}",
                row.type,
                row.distribution,
                f"{significant(row.u)} {row.unit}",
                f"{100.0 * row.share:.1f} %",
                row.source,
            ]
            for row in _folded(budget.rows)
        ]
    heads = ["result and its contributions", "type", "distribution", "u", "share of u²", "source, or coverage"]
    table = _table("", heads, rows, [3, "auto", "auto", "auto", "auto", 3], [3, 4])
    return {"title": "Uncertainty budgets", "tables": [table]} if rows else {}


def _coefficients(c: CertificateContent) -> dict[str, Any]:
    rows = []
    for coefficient in c.coefficients:
        value, error = with_uncertainty(coefficient.value, coefficient.standard_error)
        rows.append(
            [coefficient.effect.replace("_", " "), coefficient.name, coefficient.axis, value, error, coefficient.unit]
        )
    heads = ["effect", "coefficient", "axis", "value", "standard uncertainty of noise", "unit"]
    table = _table("", heads, rows, [2, "auto", "auto", "auto", "auto", 1], [3, 4])
    text = "Coefficients of the fit. The stated uncertainty is that of the results above; noise alone is printed here."
    return {"title": "Coefficients", "before": [text], "tables": [table]} if rows else {}
