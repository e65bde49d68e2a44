"""The report of a diagnosis: one HTML file that opens without a network."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial import effects
from inertial.criticism.diagnosis import Diagnosis
from inertial.data_errors.handling import named as handled
from inertial.uncertainty.rounding import chance, equal
from pipelines.report.diagnosis_pictures import driver_chart, model_chart, pose_chart
from pipelines.report.interactive import figure_of, interactive
from pipelines.report.numbers import significant
from pipelines.report.residual_table import LEAST_LOG10_P, ladder_of
from pipelines.report.residuals import bands_without_zero, drivers_shown, lot_residuals
from pipelines.report.templates import template
from pipelines.tables.dwells import Measured
from schemas.units import MICRO

FEWEST_POSES = 4  # fewer make no map


def render_diagnosis(
    document: dict[str, Any],
    measurement: Measured,
    diagnosis: Diagnosis | None,
    source: str,
    coefficients: list[dict[str, Any]] | None = None,
) -> str:
    """The report as one HTML text that needs no other file.

    Parameters
    ----------
    document : the diagnosis for programs, with its extras
    measurement, diagnosis : the readings and their diagnosis; None if every unit has a data fault
    source : name of the dwells
    coefficients : rows of the fit's table, to be shown with it; none where None
    """
    faulty = {unit for fault in document["blocked_by"] for unit in fault["units"]}
    sound = tuple(unit for unit in measurement.units if unit not in faulty)
    page = template("diagnosis.html").render(
        source=source,
        document=document,
        coefficients=coefficients or [],
        units=len(measurement.units),
        classes=[_class(group, document) for group in document["classes"]],
        unseen=[
            (name, document.get("reasons", {}).get(name) or document["breakers"][name]) for name in document["unseen"]
        ],
        pictures=None if diagnosis is None else _pictures(diagnosis, sound),
        ladder=[] if diagnosis is None else _ladder(diagnosis),
        number=significant,
        chance=chance,
        equal=equal,
    )
    return interactive(page)


def _class(group: dict[str, Any], document: dict[str, Any]) -> dict[str, Any]:
    simplest = next((name for name in document["recommended"] if name in group["effects"]), group["effects"][0])
    if group["scope"] == "data":
        values = [group.get("evidence", "")]
    else:
        own = group.get("nonlinear_of") or simplest
        known = [p for p in effects.get(own).nonlinear if group["nonlinear"].get(p.name) is not None]
        values = [f"{p.name} = {_value(group['nonlinear'][p.name])} {p.unit}".rstrip() for p in known]
        if values and len(group["effects"]) > 1:
            values[0] = f"{own}: {values[0]}"
    members = [_member(name) for name in group["effects"]]
    return {**group, "members": members, "recommended": simplest, "values": ", ".join(values)}


def _member(name: str) -> dict[str, str]:
    """An effect, or a handling error, with its symbol and equation."""
    known = handled(name) or (effects.get(name) if name in effects.catalogue() or ":" in name else None)
    if known is None:
        return {"id": name, "symbol": "", "equation": "one dwell of one unit"}
    return {"id": name, "symbol": known.symbol, "equation": known.equation}


def _value(value: float | tuple[float, ...] | list[float] | None) -> str:
    """A number, or one per axis."""
    if isinstance(value, list | tuple):
        return " / ".join(significant(float(v)) for v in value)
    return "" if value is None else significant(value)


def _pictures(diagnosis: Diagnosis, units: tuple[str, ...]) -> dict[str, Any]:
    lot = diagnosis.problem.lot
    left = lot_residuals(diagnosis, units)
    drivers = drivers_shown(diagnosis)
    excluding = bands_without_zero(left, drivers)
    force, models = lot.state.force[left.shown], [(label, residual[left.shown]) for label, residual in left.models]
    return {
        "turned": lot.state.temperature is not None and any(series.name == "unit_C" for series in drivers),
        "excluding": excluding,
        "bands": len(drivers) * len(left.axes),
        "unit": left.unit,
        "several": len(units) > 1,
        "added": left.before is not left.after,
        "model": figure_of(model_chart(left, lot.state, lot.output, MICRO * diagnosis.floor)),
        "maps": figure_of(pose_chart(left.unit, left.axes, force, models)) if _poses(force) >= FEWEST_POSES else "",
        "drivers": figure_of(driver_chart(left, drivers, lot.state.temperature)) if drivers else "",
    }


def _poses(force: NDArray[np.float64]) -> int:
    """Number of different poses."""
    return len(np.unique(np.round(force, 2), axis=0))


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
