"""Errors of a device after its run: flicker until the due date, switching on, ageing, for one unit and axis."""

from __future__ import annotations

import numpy as np
import pandas as pd

from inertial.uncertainty.period import (
    DAY_S,
    MONTH_S,
    YEAR_S,
    Windows,
    bounded_walk,
    flicker_later,
    flicker_within,
    logarithmic,
    walk_later,
)
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from schemas.validity import Ageing

RECTANGULAR = float(np.sqrt(3.0))


def period_of(tables: BudgetTables, terms: BudgetTerms, unit: str, axis: str, span_s: float) -> dict[str, float] | None:
    """The contributions over the period to the error of a unit's axis, see :func:`after_run`; None where B is not known, too."""
    instability = instability_of(tables, unit, axis)
    if terms.stability is None or not np.isfinite(instability):
        return None
    return after_run(terms, span_s, instability, walk_of(tables, unit, axis))


def after_run(terms: BudgetTerms, span_s: float, instability: float, walk: float = 0.0) -> dict[str, float] | None:
    """Standard deviations, µg, of what is added to the error of a run until a use at the end of the period of validity.

    None where the stability of the device is not stated, or not for so long.

    Parameters
    ----------
    span_s : of the dwells of the fit; instability : B, µg; walk : K, µg/√s
    """
    stability, gap = terms.stability, terms.certificate.validity_months * MONTH_S
    if stability is None or gap > stability.horizon_days * DAY_S * 1.001:
        return None
    windows = Windows(span_s, terms.certificate.use_window_s or terms.dwell_s, gap)
    later, within = (f(windows, stability.flicker_slowest_s) for f in (flicker_later, flicker_within))
    parts = {
        "flicker": instability * float(np.sqrt(max(later**2 - within**2, 0.0))),
        "switch_on": stability.switch_on_ug,
        "switch_on_scale": stability.switch_on_ppm / RECTANGULAR,  # RMS of the force along an axis is 1/√3 g
    }
    if walk > 0.0:
        parts["random_walk"] = walk * walk_carried(windows, stability.flicker_slowest_s)
    if stability.ageing is not None:
        parts["ageing"] = ageing_u(stability.ageing, windows)
    return {name: value for name, value in parts.items() if value > 0.0 or name == "flicker"}


def walk_carried(windows: Windows, slowest: float | None) -> float:
    """Standard deviation of the random walk of a run at a use after it, for K = 1/√s.

    It goes on over the run and the period, but is bounded: by the slowest time constant that the history of the device shows,
    and no less than calibration and a use as long as it show themselves, each by a third of its length. Carried on for a year,
    K of an hour would grow by a factor of a hundred, to more than devices do; slower changes are ageing.
    """
    bound = max(slowest or 0.0, 2.0 * windows.calibration / 3.0)
    return min(walk_later(windows), float(np.sqrt(bound)))


def walk_of(tables: BudgetTables, unit: str, axis: str) -> float:
    """Random walk K, µg/√s: of the static record if identified there, otherwise that of the fit, within the record's limit."""
    of_fit = float(np.nan_to_num(_of_fit(tables.wander, unit, axis, "bias_walk_ug_rts")))
    shown, identified = _of_record(tables.noise, unit, axis, "K")
    return shown if identified else float(np.fmin(shown, of_fit))


def ageing_u(ageing: Ageing, windows: Windows) -> float:
    """Standard uncertainty by ageing, µg: a bound of a drift is rectangular (JCGM 100, 4.3.7)."""
    gap = windows.gap
    if ageing.form == "log":
        return logarithmic(ageing.per_decade_ug or 0.0, gap) / RECTANGULAR
    if ageing.form == "linear":
        return (ageing.per_year_ug or 0.0) * gap / YEAR_S / RECTANGULAR
    if ageing.form == "walk":
        return (ageing.walk_ug_rtday or 0.0) / float(np.sqrt(DAY_S)) * walk_later(windows)
    return bounded_walk(ageing.deviation_ug or 0.0, (ageing.correlation_days or 1.0) * DAY_S, gap)


def instability_of(tables: BudgetTables, unit: str, axis: str) -> float:
    """Bias instability B, µg: of the static record, its upper limit where it is not identified; without one that of the fit."""
    shown, _ = _of_record(tables.noise, unit, axis, "B")
    return shown if np.isfinite(shown) else _of_fit(tables.wander, unit, axis, "bias_instability_ug")


def _of_record(noise: pd.DataFrame, unit: str, axis: str, term: str) -> tuple[float, bool]:
    """A term of the static record, else its upper limit, and whether it is identified; nan without a record."""
    own = noise[(noise["unit"] == unit) & (noise["axis"] == axis) & (noise["term"] == term)] if len(noise) else noise
    if not len(own):
        return float("nan"), False
    first = own.iloc[0]
    identified = bool(first["identified"])
    return float(first["value"] if identified else first["high"]), identified


def _of_fit(wander: pd.DataFrame, unit: str, axis: str, name: str) -> float:
    if name not in wander:
        return float("nan")
    own = wander[(wander["unit"] == unit) & (wander["axis"] == axis)]
    return float(own[name].iloc[0]) if len(own) else float("nan")
