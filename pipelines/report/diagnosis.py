"""The report of a diagnosis: one HTML file that opens without a network."""

from typing import Any

import numpy as np

from inertial import effects
from inertial.criticism.diagnosis import Diagnosis
from inertial.data_errors.handling import named as handled
from pipelines.diagnosis.diagnose import Examination
from pipelines.diagnosis.documents import DiagnosisDocument, EffectClassDocument
from pipelines.diagnosis.sections import worded
from pipelines.report.diagnosis_pictures import driver_chart, noise_chart, pose_chart
from pipelines.report.effect_view import effect_chart, effect_views
from pipelines.report.interactive import figure_of, interactive
from pipelines.report.numbers import significant
from pipelines.report.residual_table import LEAST_LOG10_P, ladder_of
from pipelines.report.residuals import bands_without_zero, drivers_shown, lot_residuals
from pipelines.report.templates import template
from schemas.units import MICRO

FEWEST_POSES = 4  # fewer make no map


def render_diagnosis(made: Examination, source: str, coefficients: list[dict[str, Any]] | None = None) -> str:
    """The report as one HTML text that needs no other file.

    Parameters
    ----------
    made : the diagnosis, its readings and its document
    source : name of the dwells
    coefficients : rows of the fit's table, to be shown with it; none where None
    """
    document, diagnosis = made.document, made.diagnosis
    page = template("diagnosis.html").render(
        source=source,
        document=document,
        coefficients=coefficients or [],
        units=len(made.measured.units),
        **worded(document),
        members=[_members(group, document) for group in document["classes"]],
        pictures=None if diagnosis is None else _pictures(diagnosis, made.sound),
        ladder=[] if diagnosis is None else _ladder(diagnosis),
        number=significant,
    )
    return interactive(page)


def _members(group: EffectClassDocument, document: DiagnosisDocument) -> list[dict[str, Any]]:
    """The effects of a class, or its handling errors, each with symbol and equation, and which of them is recommended."""
    simplest = next((name for name in document["recommended"] if name in group["effects"]), group["effects"][0])
    members: list[dict[str, Any]] = []
    for name in group["effects"]:
        known = handled(name) or (effects.get(name) if name in effects.catalogue() or ":" in name else None)
        symbol, equation = ("", "one dwell of one unit") if known is None else (known.symbol, known.equation)
        members.append({"id": name, "symbol": symbol, "equation": equation, "recommended": name == simplest})
    return members


def _pictures(diagnosis: Diagnosis, units: tuple[str, ...]) -> dict[str, Any]:
    lot = diagnosis.problem.lot
    left = lot_residuals(diagnosis, units)
    drivers = drivers_shown(diagnosis)
    excluding = bands_without_zero(left, drivers)
    force, models = lot.state.force[left.shown], [(label, residual[left.shown]) for label, residual in left.models]
    poses = len(np.unique(np.round(force, 2), axis=0))
    return {
        "turned": lot.state.temperature is not None and any(series.name == "unit_C" for series in drivers),
        "excluding": excluding,
        "bands": len(drivers) * len(left.axes),
        "unit": left.unit,
        "several": len(units) > 1,
        "added": left.before is not left.after,
        "effects": [(view.title, figure_of(effect_chart(view))) for view in effect_views(diagnosis, units)],
        "noise": figure_of(noise_chart(left, MICRO * diagnosis.floor)),
        "maps": figure_of(pose_chart(left.unit, left.axes, force, models)) if poses >= FEWEST_POSES else "",
        "drivers": figure_of(driver_chart(left, drivers, lot.state.temperature)) if drivers else "",
    }


def _ladder(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The candidates of the first step as texts, best first; χ² over the final variance."""
    rows = ladder_of(diagnosis)
    most = max([1e-12, *(row["chi2"] for row in rows)])
    return [
        {
            "id": row["effect"],
            "symbol": row["symbol"],
            "coefficients": row["coefficients"],
            "drop": significant(row["chi2"]),
            "width": f"{100.0 * max(row['chi2'], 0.0) / most:.1f}",
            "behind": significant(row["behind"]),
            "exponent": significant(-row["log10_p"]) if row["log10_p"] > LEAST_LOG10_P else "> 300",
        }
        for row in rows
    ]
