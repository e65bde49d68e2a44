"""Errors of a unit over the period of validity: the RMS expected of each axis, and the distribution of the largest of the three.

A use at the end of the period meets, on each axis, what the model left in the run, noise like that of the run, a change of the
bias (flicker, random walk, switching on, ageing), a change of the scale, and the errors of the references. What is known of them
is a standard deviation each, so the RMS of an axis is a root of a sum of squares with few degrees of freedom, and the largest of
three axes lies well above the RMS that is expected of one.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import pandas as pd
from scipy.special import ndtri, stdtrit
from scipy.stats import qmc

from inertial.arrays import Array
from inertial.uncertainty import period
from inertial.uncertainty.period import Windows
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from schemas.decisions import BOUND_SHARE
from schemas.validity import Ageing

DRAWS = 2048
OF_AXIS = 4
"""Numbers drawn for each axis: noise, change of the bias, switching on, scale."""
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class AxisErrors:
    """The parts of the error of one axis in a use, (units,) each where not said otherwise; µg.

    run, mean : RMS and mean of the errors of the verification
    expected, dof : RMS of a correct model, and degrees of freedom of its square
    fixed : standard deviation by the references, as far as the verification cannot show them; form : (q, q), mean square of the
        errors over the poses as a quadratic form of independent normal influences, of any scale
    later : standard deviations of the changes after the run, by name; of ``switch_on_scale`` the RMS over the poses
    """

    run: Array
    expected: Array
    dof: Array
    mean: Array
    fixed: Array
    form: Array
    later: dict[str, Array] = field(default_factory=dict[str, "Array"])

    @property
    def value(self) -> Array:
        """RMS error expected, µg."""
        return np.sqrt(self.run**2 + self.fixed**2 + np.sum([part**2 for part in self.later.values()], axis=0))


def largest_error(axes: list[AxisErrors], switch_on_dof: float) -> tuple[Array, Array]:
    """Median and 95 % bound of the largest RMS error of the axes in a use, (units,) each, µg.

    Parameters
    ----------
    switch_on_dof : degrees of freedom that the scatter of switching on is known from
    """
    units, q = axes[0].run.size, axes[0].form.shape[0]
    uniform = _uniform(q + OF_AXIS * len(axes))
    influences = ndtri(uniform[:, :q])
    out = np.zeros((2, units))
    forms = [_form(axis, influences) for axis in axes]
    draws = [uniform[:, q + OF_AXIS * k : q + OF_AXIS * (k + 1)] for k in range(len(axes))]
    normal = [ndtri(columns) for columns in draws]
    again = [stdtrit(switch_on_dof, columns[:, 2]) for columns in draws]
    for unit in range(units):
        largest = np.zeros(DRAWS)
        for axis, form, z, switched in zip(axes, forms, normal, again, strict=True):
            np.maximum(largest, _square(axis, unit, form, z, switched), out=largest)
        out[:, unit] = np.sqrt(np.quantile(largest, (0.5, BOUND_SHARE)))
    return out[0], out[1]


def _square(axis: AxisErrors, unit: int, form: Array, z: Array, switched: Array) -> Array:
    """Draws of the mean square error of an axis of a unit, µg²."""
    later = {name: float(values[unit]) for name, values in axis.later.items()}
    scale, on = later.pop("switch_on_scale", 0.0), later.pop("switch_on", 0.0)
    moved = np.sqrt(sum(value**2 for value in later.values())) * z[:, 1] + on * switched
    noise = float(axis.expected[unit]) ** 2 * _chi_squared(float(axis.dof[unit]), z[:, 0])
    left = max(float(axis.run[unit] ** 2 - axis.expected[unit] ** 2), 0.0)
    mean = float(axis.mean[unit]) * np.sqrt(left) / max(float(axis.run[unit]), _TINY)
    return left + 2.0 * mean * moved + moved**2 + noise + (scale * z[:, 3]) ** 2 + float(axis.fixed[unit]) ** 2 * form


def _form(axis: AxisErrors, influences: Array) -> Array:
    """Draws of the squared error by the references, of mean 1."""
    trace = float(np.trace(axis.form))
    if not trace > 0.0:
        return np.ones(len(influences))
    return np.einsum("nq,nq->n", influences @ axis.form, influences) / trace


def _chi_squared(dof: float, z: Array) -> Array:
    """χ²/ν at normal values z (Wilson and Hilferty, Proc. Nat. Acad. Sci. 17 (1931) 684); zero below its range."""
    part = 2.0 / (9.0 * max(dof, 0.5))
    return np.maximum(1.0 - part + np.sqrt(part) * z, 0.0) ** 3


@lru_cache(maxsize=8)
def _uniform(count: int) -> Array:
    """Well-spread draws from a fixed seed, so that a repeated decision is identical."""
    draws = qmc.Sobol(count, scramble=True, rng=np.random.default_rng(20260101)).random(DRAWS)
    return np.clip(draws, 1e-9, 1.0 - 1e-9)


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
    stability, gap = terms.stability, terms.certificate.validity_months * period.MONTH_S
    if stability is None or gap > stability.horizon_days * period.DAY_S * 1.001:
        return None
    windows = Windows(span_s, terms.certificate.use_window_s or terms.dwell_s, gap)
    later, within = (f(windows, stability.flicker_slowest_s) for f in (period.flicker_later, period.flicker_within))
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
    return min(period.walk_later(windows), float(np.sqrt(bound)))


def walk_of(tables: BudgetTables, unit: str, axis: str) -> float:
    """Random walk K, µg/√s: of the static record if identified there, otherwise that of the fit, within the record's limit."""
    of_fit = float(np.nan_to_num(_of_fit(tables.wander, unit, axis, "bias_walk_ug_rts")))
    shown, identified = _of_record(tables.noise, unit, axis, "K")
    return shown if identified else float(np.fmin(shown, of_fit))


def ageing_u(ageing: Ageing, windows: Windows) -> float:
    """Standard uncertainty by ageing, µg: a bound of a drift is rectangular (JCGM 100, 4.3.7)."""
    gap = windows.gap
    if ageing.form == "log":
        return period.logarithmic(ageing.per_decade_ug or 0.0, gap) / RECTANGULAR
    if ageing.form == "linear":
        return (ageing.per_year_ug or 0.0) * gap / period.YEAR_S / RECTANGULAR
    if ageing.form == "walk":
        return (ageing.walk_ug_rtday or 0.0) / float(np.sqrt(period.DAY_S)) * period.walk_later(windows)
    return period.bounded_walk(ageing.deviation_ug or 0.0, (ageing.correlation_days or 1.0) * period.DAY_S, gap)


def instability_of(tables: BudgetTables, unit: str, axis: str) -> float:
    """Bias instability B, µg: of the static record, its upper limit where it is not identified; of the fit without a record."""
    shown, _ = _of_record(tables.noise, unit, axis, "B")
    return shown if np.isfinite(shown) else _of_fit(tables.wander, unit, axis, "bias_instability_ug")


def _of_record(noise: pd.DataFrame, unit: str, axis: str, term: str) -> tuple[float, bool]:
    """A term of the static record, else its upper limit, and whether it is identified; nan without a record."""
    terms = noise[(noise["unit"] == unit) & (noise["axis"] == axis) & (noise["term"] == term)] if len(noise) else noise
    if not len(terms):
        return float("nan"), False
    first = terms.iloc[0]
    identified = bool(first["identified"])
    return float(first["value"] if identified else first["high"]), identified


def _of_fit(wander: pd.DataFrame, unit: str, axis: str, name: str) -> float:
    if name not in wander:
        return float("nan")
    rows = wander[(wander["unit"] == unit) & (wander["axis"] == axis)]
    return float(rows[name].iloc[0]) if len(rows) else float("nan")
