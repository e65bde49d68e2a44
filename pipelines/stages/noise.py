"""Noise of the static record: Allan deviation with honest intervals, and the terms that it needs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from inertial.noise.allan import AllanCurve, overlapping
from inertial.noise.terms import FLICKER_FLOOR, NoiseTerms, fit_terms, model_deviation
from pipelines.tables.calibration import read_calibration
from pipelines.tables.frames import empty_table
from pipelines.tables.samples import by_record
from schemas.errors import DataRejected
from schemas.units import AXES, MICRO

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

MOST_SAMPLES = (
    2**18
)  # of a channel that lie in memory: 24 h at 100 Hz are means of 33 samples, and tau begins at 0.33 s
UNEXPLAINED_P = 1e-6  # the covariance of the curve is itself estimated, so only a plain misfit counts
N_ONE_SIDED = "n_d"
B_BOUND = "B_bound"


def noise(
    samples: Iterable[pd.DataFrame], readings: pd.DataFrame, coefficients: pd.DataFrame, covariance: pd.DataFrame
) -> dict[str, pd.DataFrame]:
    """Allan curves (table ``allan``) and noise terms (table ``noise``) of every calibrated unit, in µg.

    Terms: Q, N, B, K, R as in IEEE Std 952 (N is two-sided: σ(τ) = N/√τ); ``n_d`` = N·√2 is the one-sided density of
    data sheets; ``B_bound`` = min σ/0.664 is only an upper bound of B. Records longer than 2¹⁸ samples are read table by
    table and averaged down to that many, so that their curves begin at a longer averaging time.
    """
    static = readings[(readings["kind"] == "allan") & (readings["status"] == "ok")]
    if static.empty or coefficients.empty:
        return _nothing()
    calibration = read_calibration(coefficients, covariance)
    records = set(static["record"])
    size = -(-int(static.loc[static["unit"].isin(calibration.units), "n"].max()) // MOST_SAMPLES)
    series = StaticRecord(calibration.units, size)
    for record, tables in by_record(samples):
        for table in tables:
            if record in records:
                series.add(table)
    scale = np.diagonal(calibration.response, axis1=-2, axis2=-1)
    curve = overlapping(MICRO * series.values() / scale[..., None], float(static["rate_hz"].iloc[0]) / size)
    try:
        terms = fit_terms(curve)
    except ValueError as problem:
        raise DataRejected(str(problem)) from None
    terms = limits_where_unexplained(curve, terms)
    return {"allan": _curve_rows(calibration.units, curve, terms), "noise": _term_rows(calibration.units, terms)}


def limits_where_unexplained(curve: AllanCurve, terms: NoiseTerms) -> NoiseTerms:
    """The terms, with mere upper limits for channels whose curve no mixture of the five terms explains.

    Each term alone can be no larger than the whole curve anywhere: N ≤ min σ·√τ, B ≤ min σ/0.664, K ≤ min σ·√(3/τ), …
    """
    tau, sigma = curve.tau, curve.high
    ceilings = {
        "Q": sigma * tau / np.sqrt(3.0),
        "N": sigma * np.sqrt(tau),
        "B": sigma / FLICKER_FLOOR,
        "K": sigma * np.sqrt(3.0 / tau),
        "R": sigma * np.sqrt(2.0) / tau,
    }
    limit = np.stack([np.min(ceilings[symbol], axis=-1) for symbol in terms.symbols], axis=-1)
    unexplained = (terms.p_value < UNEXPLAINED_P)[..., None]
    return replace(
        terms,
        value=np.where(unexplained, np.nan, terms.value),
        low=np.where(unexplained, 0.0, terms.low),
        high=np.where(unexplained, limit, terms.high),
    )


class StaticRecord:
    """Outputs of the static record, gathered table by table; of a long one the means of ``size`` samples each.

    The Allan deviation of means is that of the samples themselves, from an averaging time of ``size`` samples on.
    """

    def __init__(self, units: Sequence[str], size: int) -> None:
        self._size = max(size, 1)
        self._rest: dict[str, NDArray[np.float64]] = {unit: np.zeros((0, 3)) for unit in units}
        self._means: dict[str, list[NDArray[np.float64]]] = {unit: [] for unit in units}

    def add(self, samples: pd.DataFrame) -> None:
        """Takes the samples that follow those before."""
        output = samples[list(AXES)].to_numpy(dtype=float)
        for unit, rows in samples.groupby("unit", sort=False).indices.items():
            if unit in self._rest:
                joined = np.concatenate((self._rest[str(unit)], output[rows]))
                whole = len(joined) // self._size * self._size
                self._means[str(unit)].append(joined[:whole].reshape(-1, self._size, 3).mean(axis=1))
                self._rest[str(unit)] = joined[whole:]

    def values(self) -> NDArray[np.float64]:
        """Outputs (units, 3, n), as long as the shortest."""
        series = [np.concatenate(parts or [np.zeros((0, 3))]) for parts in self._means.values()]
        shortest = min(len(one) for one in series)
        return np.stack([one[:shortest].T for one in series])


def _curve_rows(units: tuple[str, ...], curve: AllanCurve, terms: NoiseTerms) -> pd.DataFrame:
    u, a, t = (i.ravel() for i in np.meshgrid(*(np.arange(s) for s in curve.deviation.shape), indexing="ij"))
    return pd.DataFrame(
        {
            "unit": np.asarray(units, dtype=object)[u],
            "axis": np.asarray(AXES, dtype=object)[a],
            "tau_s": curve.tau[t],
            "deviation_ug": curve.deviation.ravel(),
            "low_ug": curve.low.ravel(),
            "high_ug": curve.high.ravel(),
            "fitted_ug": _fitted(curve, terms).ravel(),
        }
    )


def _fitted(curve: AllanCurve, terms: NoiseTerms) -> NDArray[np.float64]:
    """Deviation of the fitted terms; NaN for channels that they do not explain."""
    identified = np.any(np.isfinite(terms.value), axis=-1)[..., None]
    return np.where(identified, model_deviation(terms, curve.tau), np.nan)


def _term_rows(units: tuple[str, ...], terms: NoiseTerms) -> pd.DataFrame:
    rows = []
    for u, unit in enumerate(units):
        for a, axis in enumerate(AXES):
            for symbol, term in terms.one(u, a).items():
                value = np.nan if term.value is None else term.value
                text = term.unit.format("µg")
                rows.append((unit, axis, symbol, value, term.low, term.high, term.identified, text))
                if symbol == "N":
                    root2 = np.sqrt(2.0)
                    ends = (root2 * value, root2 * term.low, root2 * term.high)
                    rows.append((unit, axis, N_ONE_SIDED, *ends, term.identified, "µg/√Hz"))
            bound = float(terms.bias_instability_bound[u, a])
            rows.append((unit, axis, B_BOUND, np.nan, 0.0, bound, False, "µg"))
    names = ["unit", "axis", "term", "value", "low", "high", "identified", "unit_text"]
    return pd.DataFrame(rows, columns=names)


def _nothing() -> dict[str, pd.DataFrame]:
    return {
        "allan": empty_table(texts="unit axis", numbers="tau_s deviation_ug low_ug high_ug fitted_ug"),
        "noise": empty_table(texts="unit axis term unit_text", numbers="value low high", flags="identified"),
    }
