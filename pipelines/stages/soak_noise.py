"""White noise of each soak from the samples of its dwells, and its curve over temperature."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array, Index
from inertial.decisions import LOUDER_BELOW
from inertial.distributions import NORMAL_95, normal_tail
from inertial.estimation.scatter import difference_p
from inertial.noise.allan import curve_of, variances
from inertial.noise.over_temperature import APART_K, density_curve
from inertial.noise.resolution import step_of
from inertial.noise.terms import NoiseTerms, fit_terms
from pipelines.stages.noise import FEWEST, limits_where_unexplained
from pipelines.stages.static_record import COUNTED, Coarse, remark, without_digits
from pipelines.tables.calibration import Calibration, read_calibration
from pipelines.tables.frames import empty_table, rows_of
from pipelines.tables.summaries import PROCEDURE, STATIC, by_record
from schemas.units import MICRO

GROWS, FALLS, DIFFERS, SAME, NOT_TOLD, NOT_JUDGED = ("grows", "falls", "differs", "steady", "not told", "not judged")
FALSE_RATE = 0.01
"""Probability that any axis of a run with constant noise is reported by its own ratio; divided over the axes (Bonferroni)."""
STEADY = 0.2
"""Limit of the deviation of the ratio hot/cold from 1 that its interval must not exceed for noise to be called steady."""
UNIT = "µg/√Hz"


@dataclass
class _Soak:
    """Sums over the records of equal length of one unit in one soak.

    total : (axes, t), output unit squared, sum of Allan variances · step : (axes,), output unit, finest digit, 0 if not coarse
    """

    m: Index
    n: int
    rate_hz: float
    total: Array
    step: Array
    records: int = 0
    temperatures: list[float] = field(default_factory=list[float])


def soak_noise(
    samples: Iterable[pd.DataFrame],
    readings: pd.DataFrame,
    coefficients: pd.DataFrame,
    covariance: pd.DataFrame,
) -> dict[str, pd.DataFrame]:
    """White noise N of every soak (table ``soak_noise``) and its change over temperature (table ``noise_temperature``).

    N is that of IEEE Std 952 in µg/√Hz, two-sided, with a 95 % interval: the term of the noise stage, of the mean Allan variance
    of all dwells of the soak. ``curve`` is the fitted density, ``curve_u`` its standard uncertainty. ``p_value`` is that of the F
    test for soaks of different noise in a diagnosis, over the axes of all units; each axis is also judged by its own ratio. There
    are no rows if the soaks do not differ in temperature.
    """
    if coefficients.empty:
        return _nothing()
    calibration = read_calibration(coefficients, covariance)
    soaks = _soaks(samples, readings, calibration)
    rows = [row for (unit, soak), sums in sorted(soaks.items()) for row in _soak_rows(unit, soak, sums, calibration)]
    table = pd.DataFrame(rows)
    if not rows or np.ptp(table["temperature_C"].to_numpy(dtype=float)) < APART_K:
        return _nothing()
    table = table.sort_values(["unit", "axis", "soak"], ignore_index=True)
    p = _difference(table)
    table[["curve", "curve_u"]] = np.nan
    axes = table.groupby(["unit", "axis"], sort=False)
    changes = [_change(table, rows, p, axes.ngroups) for _, rows in axes]
    known = [change for change in changes if change is not None]
    return {"soak_noise": table, "noise_temperature": pd.DataFrame(known)} if known else _nothing()


def _soaks(
    samples: Iterable[pd.DataFrame], readings: pd.DataFrame, calibration: Calibration
) -> dict[tuple[str, int], _Soak]:
    """The sums of every unit and soak, without soaks of changing temperature and records of another length."""
    static = readings[~readings["kind"].isin([STATIC, PROCEDURE]) & (readings["status"] == "ok")]
    found = {(int(r["record"]), str(r["unit"])): r for r in rows_of(static)}
    lengths = static["n"].mode()
    soaks: dict[tuple[str, int], _Soak] = {}
    for record, tables in by_record(samples):
        for unit, rows in pd.concat(tables).groupby("unit", sort=False):
            reading = found.get((record, str(unit)))
            output = rows[list(calibration.letters)].to_numpy(dtype=float).T
            n, finite = len(rows), bool(np.isfinite(output).all())
            if reading is None or n != lengths.iloc[0] or n < FEWEST or not finite:
                continue
            m, variance = variances(output, float(reading["rate_hz"]))
            soak = soaks.setdefault(
                (str(unit), int(reading["soak"])),
                _Soak(m, n, float(reading["rate_hz"]), np.zeros_like(variance), np.full(len(output), np.inf)),
            )
            soak.total += variance
            soak.step = np.fmin(soak.step, [_step(axis) for axis in output])
            soak.records += 1
            soak.temperatures.append(float(reading["unit_C"]))
    return {key: soak for key, soak in soaks.items() if np.ptp(soak.temperatures) <= APART_K}


def _step(values: Array) -> float:
    different = np.unique(values)
    return step_of(different) if different.size <= COUNTED else 0.0


def _soak_rows(unit: str, soak: int, sums: _Soak, calibration: Calibration) -> list[dict[str, Any]]:
    if unit not in calibration.units:
        return []
    scale = np.abs(calibration.scale[calibration.units.index(unit)]) / MICRO
    mean = sums.total / sums.records / scale[:, None] ** 2
    alive = np.flatnonzero((mean > 0.0).all(axis=1))
    if not alive.size:
        return []
    curve = curve_of(mean[alive], sums.m, sums.n, sums.rate_hz, sums.records)
    # the Allan variance at one sample is the sample variance from differences of neighbours
    digits = [Coarse(float(sums.step[a] / scale[a]), float(mean[a, 0]), np.inf) for a in alive.tolist()]
    terms = without_digits(limits_where_unexplained(curve, fit_terms(curve, only="N")), digits, sums.rate_hz)
    return [
        {
            "unit": unit,
            "axis": calibration.letters[axis],
            "soak": soak,
            "temperature_C": float(np.mean(sums.temperatures)),
            "dwells": sums.records,
            **_white(terms, row),
            "unit_text": UNIT,
            "note": remark(digits[row]),
        }
        for row, axis in enumerate(alive.tolist())
    ]


def _white(terms: NoiseTerms, channel: int) -> dict[str, Any]:
    n = terms.symbols.index("N")
    value, low, high = (float(part[channel, n]) for part in (terms.value, terms.low, terms.high))
    return {"value": value, "low": low, "high": high, "identified": bool(np.isfinite(value))}


def _difference(table: pd.DataFrame) -> float:
    """p-value of the differences between soaks over the axes of all units; nan for fewer than two axes with all soaks."""
    sizes = table.pivot_table(index=["unit", "axis"], columns="soak", values="value").dropna()
    if len(sizes) < 2 or sizes.shape[1] < 2:
        return float("nan")
    return difference_p(2.0 * np.log(sizes.to_numpy(dtype=float)))


def _change(table: pd.DataFrame, rows: pd.DataFrame, p: float, axes: int) -> dict[str, Any] | None:
    """The row of an axis in ``noise_temperature``, None if undetermined; its fitted curve is written into ``table``."""
    known = rows[rows["identified"]]
    temperature, value = (known[name].to_numpy(dtype=float) for name in ("temperature_C", "value"))
    u = (known["high"] - known["low"]).to_numpy(dtype=float) / (2.0 * NORMAL_95)
    curve = density_curve(temperature, value, u) if len(known) > 1 else None
    if curve is None:
        return None
    table.loc[rows.index, "curve"], table.loc[rows.index, "curve_u"] = curve.at(
        rows["temperature_C"].to_numpy(dtype=float)
    )
    cold, hot = float(temperature.min()), float(temperature.max())
    ratio, u_ratio = curve.ratio(cold, hot)
    u_p = NORMAL_95 * u_ratio
    return {
        **{name: rows[name].iloc[0] for name in ("unit", "axis")},
        "cold_C": cold,
        "hot_C": hot,
        "ratio": ratio,
        "low": ratio - u_p,
        "high": ratio + u_p,
        "p_value": p,
        "verdict": verdict(ratio, u_p, p, axes),
    }


def verdict(ratio: float, half: float, p: float, axes: int) -> str:
    """Verdict on the white noise of an axis over temperature: it grows, falls, differs, is steady, or cannot be told.

    Parameters
    ----------
    ratio, half : N of the hottest soak over that of the coldest, and its 95 % half width
    p : probability of equal soaks over the axes of the lot; nan if there is none
    axes : number of axes of all units that are judged together
    """
    # tested in the logarithm, in which the curve is fitted
    own_p = 2.0 * float(normal_tail(abs(np.log(ratio)) * NORMAL_95 * ratio / half))
    if own_p < FALSE_RATE / axes or p < LOUDER_BELOW:
        return GROWS if ratio - half > 1.0 else FALLS if ratio + half < 1.0 else DIFFERS
    if not np.isfinite([ratio, half, p]).all():
        return NOT_JUDGED
    return SAME if max(ratio + half - 1.0, 1.0 - (ratio - half)) <= STEADY else NOT_TOLD


def _nothing() -> dict[str, pd.DataFrame]:
    return {
        "soak_noise": empty_table(
            texts="unit axis unit_text note",
            numbers="temperature_C value low high curve curve_u",
            integers="soak dwells",
            flags="identified",
        ),
        "noise_temperature": empty_table(texts="unit axis verdict", numbers="cold_C hot_C ratio low high p_value"),
    }
