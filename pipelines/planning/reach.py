"""Uncertainty that a plan can reach: the planned dwells, the device's noise and what the station states, as a document."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.uncertainty.period import Windows, flicker_within
from pipelines.planning.context import PlanContext
from pipelines.schedule.planned_state import planned_dwells
from pipelines.stages.uncertainty.budget_terms import BudgetTerms
from pipelines.stages.uncertainty.reachable import PlannedDwells, reachable, unreachable
from pipelines.stages.uncertainty.tables import LABELS
from schemas.limits import Limits
from schemas.units import MICRO


def reach(context: PlanContext, covariance: Array, terms: BudgetTerms, limits: Limits | None) -> dict[str, Any] | None:
    """What a recipe can reach on its station; None where no uncertainty is stated.

    Parameters
    ----------
    covariance : (n, n), of the dwells of the fit as the fit sees them, g²
    """
    if terms.stated is None:
        return None
    dwells = planned_dwells(context.recipe, context.station, context.activities)
    noise, length = context.noise, context.recipe.dwell_s
    span = float(np.ptp(dwells.fit.time)) + length
    slowest = None if terms.stability is None else terms.stability.flicker_slowest_s
    within = noise.instability * flicker_within(Windows(span, length, 0.0), slowest)
    run = MICRO * float(np.hypot(noise.white(length), within))
    planned = PlannedDwells(*dwells, covariance, run, MICRO * noise.instability)
    reaches = reachable(planned, terms, context.recipe.effects)
    months = terms.certificate.validity_months
    return {
        "k": 2.0,
        "frame": terms.certificate.frame,
        "validity_months": months,
        "grade_source": terms.stated.grade_source,
        "not_stated": terms.stated.not_stated,
        "quantities": [
            {
                "quantity": one.quantity,
                "axis": one.axis,
                "unit": one.unit,
                "u": one.u,
                "expanded": 2.0 * one.u,
                "shares": {LABELS[name]: share for name, share in one.shares.items() if share >= 5e-4},
            }
            for one in reaches
        ],
        "unreachable": [] if limits is None else unreachable(reaches, limits, months),
        "remarks": remarks(context, terms),
    }


def remarks(context: PlanContext, terms: BudgetTerms) -> list[str]:
    """What a reader should know of the statement: soaks that are too short, temperatures of the chamber, gravity by formula."""
    stated, out = terms.stated, list[str]()
    if stated is None:
        return out
    temperatures = [terms.room_C, *context.recipe.temperatures_C]
    if stated.settling is not None and (stated.thermometer is None or stated.thermometer.measures != "device"):
        tau = max(stated.settling.tau_s)
        step = max(abs(b - a) for a, b in pairwise(temperatures))
        needed, left = tau * float(np.log(max(step / 0.1, 1.0))), step * float(np.exp(-terms.soak_min_s / tau))
        if terms.soak_min_s < needed:
            out.append(
                f"soak_min_s {terms.soak_min_s:.0f}: {needed:.0f} s needed for 0.1 K; the remainder of a step of {step:.0f} K is "
                f"{left:.2g} K"
            )
    if stated.thermometer is not None and stated.thermometer.measures == "chamber":
        out.append('thermometer measures = "chamber": its offset and the gradient to the element count in full')
    if stated.gravity is not None and stated.gravity.source == "formula":
        out.append(
            f"local gravity by the formula of 1980, u = {1e6 * stated.gravity.relative().u:.0f} ppm; a survey replaces it"
        )
    return out
