"""Risk of the decisions on a lot: false acceptance and false rejection over the production that it represents (JCGM 106, 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from inertial.uncertainty.risk import global_risk, process_deviation
from pipelines.tables.frames import empty_table

if TYPE_CHECKING:
    from schemas.limits import Limits

TEXTS, NUMBERS = "figure unit_text", "mean process u limit accept pfa pfr accepted largest_pfa"
QUANTITIES = {"bias_error_ug": "bias_error", "verification_norm_ug": "verification_norm"}
"""Figures with a quantity of the budget."""
FEWEST = 3
"""Units from which the scatter of a production is estimated."""


def lot_risks(figures: pd.DataFrame, limits: Limits, uncertainties: pd.DataFrame | None) -> pd.DataFrame:
    """One row per figure with a limit: mean, process standard deviation, uncertainty, PFA and PFR.

    σ_p² = s² − u², with the part of u that differs between units; the part common to the lot is not in s. nan where fewer than
    three units were
    judged. ``largest_pfa`` is the largest specific probability of a unit that was accepted.
    """
    rows: list[dict[str, Any]] = []
    numbers = {name: figures[name].to_numpy(dtype=float) for name in ("value", "uncertainty", "limit", "accept", "pfa")}
    names, texts = (figures[name].to_numpy(dtype=object) for name in ("figure", "unit_text"))
    limited = np.flatnonzero(np.isfinite(numbers["limit"]))
    of_noise = _of_noise(uncertainties)
    for name in dict.fromkeys(names[limited].tolist()):
        places = limited[names[limited] == name]
        own = {column: values[places] for column, values in numbers.items()}
        values = own["value"]
        u = float(np.sqrt(np.mean((own["uncertainty"] / limits.coverage_factor) ** 2)))
        limit, accept = float(own["limit"][0]), float(np.nanmean(own["accept"]))
        process = process_deviation(values.tolist(), of_noise.get(QUANTITIES.get(str(name), ""), u))
        rows.append(
            {
                "figure": name,
                "unit_text": texts[places[0]],
                "units": len(values),
                "mean": float(values.mean()),
                "process": process,
                "u": u,
                "limit": limit,
                "accept": accept,
                **_risks(float(values.mean()), process, u, limit, accept, len(values)),
                "largest_pfa": float(np.fmax.reduce(own["pfa"])),
            }
        )
    return pd.DataFrame(rows) if rows else empty_table(texts=TEXTS, whole="units", numbers=NUMBERS)


def _of_noise(uncertainties: pd.DataFrame | None) -> dict[str, float]:
    """The part of u that differs between units, that of noise, by quantity; only of those that the budget separates."""
    if uncertainties is None:
        return {}
    quantity, u = uncertainties["quantity"].to_numpy(dtype=object), uncertainties["u_a"].to_numpy(dtype=float)
    parts = {name: u[quantity == name] for name in QUANTITIES.values()}
    return {name: float(np.sqrt(np.mean(own**2))) for name, own in parts.items() if own.size}


def _risks(mean: float, process: float, u: float, limit: float, accept: float, units: int) -> dict[str, float]:
    if units < FEWEST or not np.isfinite(process) or not accept > 0.0:
        return {"pfa": float("nan"), "pfr": float("nan"), "accepted": float("nan")}
    if not process > 0.0:  # the units differ by no more than their measurement: all are taken as equal to their mean
        process = 1e-6 * limit
    risk = global_risk(mean, process, u, (-limit, limit), (-accept, accept))
    return {"pfa": risk.pfa, "pfr": risk.pfr, "accepted": risk.accepted}
