"""Noise of the static record: Allan deviation with its intervals, and the noise terms that explain it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.distributions import chi2_upper
from inertial.disturbances import Disturbance, disturbance_texts, disturbances
from inertial.noise.allan import AllanCurve, overlapping
from inertial.noise.flicker import FLICKER_FLOOR
from inertial.noise.terms import NoiseTerms, fit_terms, model_deviation
from pipelines.stages.static_record import Coarse, StaticSeries, Warmed, remark, warmed, without_digits
from pipelines.tables.calibration import Calibration, read_calibration
from pipelines.tables.frames import empty_table
from pipelines.tables.summaries import by_record
from schemas.units import MICRO

TERM = "stability_1h"
HOUR_S = 3600.0
MEAN_S = 100.0
_TAIL, ONE_SIDED = 0.025, 0.05
PARTS = 100
"""Number of parts of each mean, whose differences give its white noise."""


def bias_stability(record: Array, rate_hz: float) -> tuple[float, float, float] | None:
    """Standard deviation of 36 means of 100 s, and the ends of its 95 % interval by χ²; None for less than an hour of record.

    Under wander the means are not independent: the degrees of freedom are those of the noise in the record. Drift is included.

    Parameters
    ----------
    record : (n,), at ``rate_hz``; the results have its unit
    """
    length, count = round(MEAN_S * rate_hz), int(HOUR_S / MEAN_S)
    if length < 1 or record.size < count * length or not np.all(np.isfinite(record[-count * length :])):
        return None
    from inertial.dynamics.stability import dof_of_means  # loads scipy.stats, which a shorter record does not need

    means = record[-count * length :].reshape(count, length).mean(axis=1)
    size = max(1, length // PARTS)
    short = record[-(count * length // size * size) :].reshape(-1, size).mean(axis=1)
    white = float(np.var(np.diff(short), ddof=1)) / 2.0 * size / length
    value, dof = float(np.std(means, ddof=1)), dof_of_means(means, white)
    low, high = (value * float(np.sqrt(dof / chi2_upper(p, dof))) for p in (_TAIL, 1.0 - _TAIL))
    return value, low, high


MOST_SAMPLES = (
    2**18
)  # samples of a channel held in memory: 24 h at 100 Hz are averaged over 33 samples, so that tau begins at 0.33 s
UNEXPLAINED_P = (
    1e-6  # p-value of a misfit: only a clear one counts, because the covariance of the curve is estimated, too
)
FEWEST = 192  # samples of a channel: they give six averaging times, the fewest for five terms
MOVED_K = 0.01  # change of temperature during a record above which it is stated
N_ONE_SIDED = "n_d"
B_BOUND = "B_bound"
UNITS = {"Q": "µg·s", "N": "µg/√Hz", N_ONE_SIDED: "µg/√Hz", "B": "µg", "K": "µg/√s", "R": "µg/s", B_BOUND: "µg"}
TERM_COLUMNS = ["unit", "axis", "term", "value", "low", "high", "identified", "unit_text", "note"]


@dataclass(frozen=True)
class StaticChannel:
    """The record (n,), µg, of one axis of one unit without its temperature response; ``silent``: why it has no noise figures."""

    unit: str
    axis: str
    record: np.ndarray
    digits: Coarse
    warmth: str
    silent: str


@dataclass(frozen=True)
class StaticRecord:
    """The static record of a run; each value of the channels is the mean of ``size`` samples at ``rate_hz``."""

    channels: list[StaticChannel]
    rate_hz: float
    size: int


def noise(record: StaticRecord | None) -> dict[str, pd.DataFrame]:
    """Allan curves (table ``allan``) and noise terms (table ``noise``) of every calibrated unit, in µg; empty without a record.

    Terms: Q, N, B, K, R as in IEEE Std 952 (N is two-sided: σ(τ) = N/√τ); ``n_d`` = N·√2 is the one-sided density of
    data sheets; ``B_bound`` = min σ/0.664 is only an upper bound of B. Records longer than 2¹⁸ samples are read table by table
    and averaged to that length, so that their curves begin at a longer averaging time. The response of the output to the
    temperature of the record, by the model's tempco, is subtracted first. The rounding of coarse digits is subtracted from N if
    possible. A channel that is silent, too short or not finite has rows without a value, one with spikes, a louder stretch or a
    jump has upper limits alone. The column ``note`` states each of these.
    """
    if record is None:
        return _nothing()
    channels, rate, size = record.channels, record.rate_hz, record.size
    curves, rows = list[pd.DataFrame](), list[tuple[object, ...]]()
    for group in alike(channels):
        curve = overlapping(np.stack([channel.record for channel in group]), rate / size)
        disturbed = [disturbances(channel.record) for channel in group]
        terms = limits_where_unexplained(curve, without_disturbed(fit_terms(curve), disturbed))
        terms = without_digits(terms, [channel.digits for channel in group], rate)
        curves.append(_curve_rows(group, curve, terms))
        noted = [
            replace(
                channel, warmth="; ".join(filter(None, [*disturbance_texts(found, rate / size, "µg"), channel.warmth]))
            )
            for channel, found in zip(group, disturbed, strict=True)
        ]
        rows += [row for index, channel in enumerate(noted) for row in _term_rows(channel, terms, index)]
        for channel in noted:
            stability = bias_stability(channel.record, rate / size)
            if stability is not None:
                rows.append((channel.unit, channel.axis, TERM, *stability, True, "µg", channel.warmth))
    for channel in channels:
        if channel.silent:
            rows += [
                (channel.unit, channel.axis, term, np.nan, 0.0, np.nan, False, text, channel.silent)
                for term, text in UNITS.items()
            ]
    order = {(channel.unit, channel.axis): index for index, channel in enumerate(channels)}
    rows.sort(key=lambda row: order[str(row[0]), str(row[1])])
    return {
        "allan": _sorted(pd.concat(curves, ignore_index=True), order) if curves else _nothing()["allan"],
        "noise": pd.DataFrame(rows, columns=TERM_COLUMNS),
    }


def static_record(
    samples: Iterable[pd.DataFrame],
    readings: pd.DataFrame,
    coefficients: pd.DataFrame,
    covariance: pd.DataFrame,
    history: pd.DataFrame | None = None,
) -> StaticRecord | None:
    """The channels of every calibrated unit; None where no record was taken or no unit is calibrated.

    Parameters
    ----------
    history : temperatures between the dwells; no response to the temperature is subtracted if None
    """
    static = readings[(readings["kind"] == "allan") & (readings["status"] == "ok")]
    if static.empty or coefficients.empty:
        return None
    calibration = read_calibration(coefficients, covariance)
    records = set(static["record"])
    size = -(-int(static.loc[static["unit"].isin(calibration.units), "n"].max()) // MOST_SAMPLES)
    series = StaticSeries(calibration.units, size, calibration.letters)
    for record, tables in by_record(samples):
        for table in tables:
            if record in records:
                series.add(table)
    rate = float(static["rate_hz"].iloc[0])
    channels = [
        channel
        for unit in calibration.units
        for channel in _channels(series, calibration, unit, static[static["unit"] == unit], rate, history)
    ]
    return StaticRecord(channels, rate, series.size)


def _channels(
    series: StaticSeries,
    calibration: Calibration,
    unit: str,
    static: pd.DataFrame,
    rate: float,
    history: pd.DataFrame | None,
) -> list[StaticChannel]:
    output = series.of(unit)
    scale = calibration.scale[calibration.units.index(unit)] / MICRO
    if len(static):
        start = float(static["start_s"].iloc[0])
        time = np.asarray(start + (np.arange(len(output)) + 0.5) * series.size / rate, dtype=np.float64)
        warm = warmed(calibration, unit, time, static.iloc[0], history)
    else:
        warm = Warmed(np.zeros_like(output), float("nan"), known=True)
    return [
        StaticChannel(
            unit=unit,
            axis=letter,
            record=(output[:, axis] - warm.change[:, axis]) / scale[axis],
            digits=Coarse.of(series.digits[unit][axis], float(scale[axis])),
            warmth=_warmth(warm, float(np.ptp(warm.change[:, axis]) / abs(scale[axis])) if len(output) else 0.0),
            silent=_why_silent(output[:, axis]),
        )
        for axis, letter in enumerate(calibration.letters)
    ]


def _warmth(warm: Warmed, change_ug: float) -> str:
    """The remark about the temperature during a record."""
    if not warm.span_K > MOVED_K:
        return ""
    moved = f"the temperature moved by {warm.span_K:.2g} K during the record"
    if warm.known:
        return f"{moved}; the share of the known tempco, {change_ug:.2g} µg, is subtracted"
    return f"{moved}; the model has no tempco to correct it, so that B, K and R may include the effect of temperature"


def _why_silent(values: np.ndarray) -> str:
    """The reason why a channel has no noise figures; empty if it has."""
    if len(values) < FEWEST:
        return f"{len(values)} samples in the static record, {FEWEST} are needed; record longer"
    if not np.all(np.isfinite(values)):
        return "a sample of the static record is not finite; measure again"
    if np.ptp(values) == 0.0:
        return "the output never changed: the channel is dead, or its noise is below its last digit"
    return ""


def alike(channels: list[StaticChannel]) -> list[list[StaticChannel]]:
    """The usable channels, grouped by length of record."""
    lengths = dict.fromkeys(len(channel.record) for channel in channels if not channel.silent)
    return [
        [channel for channel in channels if not channel.silent and len(channel.record) == length] for length in lengths
    ]


def _sorted(curves: pd.DataFrame, order: dict[tuple[str, str], int]) -> pd.DataFrame:
    position = [order[key] for key in zip(curves["unit"], curves["axis"], strict=True)]
    return curves.iloc[np.argsort(position, kind="stable")].reset_index(drop=True)


def without_disturbed(terms: NoiseTerms, disturbed: Sequence[Sequence[Disturbance]]) -> NoiseTerms:
    """The terms with χ² set to infinity for channels with material disturbances, which no mixture of terms describes."""
    return replace(
        terms,
        chi2=np.where([any(disturbance.material for disturbance in found) for found in disturbed], np.inf, terms.chi2),
    )


def limits_where_unexplained(curve: AllanCurve, terms: NoiseTerms) -> NoiseTerms:
    """The terms, with upper limits only for channels whose curve no mixture of the five terms explains.

    No single term can exceed the curve at any averaging time: N ≤ min σ·√τ, B ≤ min σ/0.664, K ≤ min σ·√(3/τ), … Because the
    minimum of many uncertain limits is too low, each limit has 5 % divided by the number of averaging times (Bonferroni).
    """
    tau = curve.tau
    tail = 1.0 - ONE_SIDED / tau.size
    sigma = curve.deviation * np.sqrt(curve.edf / chi2_upper(tail, curve.edf))
    ceilings = {
        "Q": sigma * tau / np.sqrt(3.0),
        "N": sigma * np.sqrt(tau),
        "B": sigma / FLICKER_FLOOR,
        "K": sigma * np.sqrt(3.0 / tau),
        "R": sigma * np.sqrt(2.0) / tau,
    }
    limit = np.stack([np.min(ceilings[symbol], axis=-1) for symbol in terms.symbols], axis=-1)
    unexplained = ~(terms.p_value >= UNEXPLAINED_P)[..., None]
    return replace(
        terms,
        value=np.where(unexplained, np.nan, terms.value),
        low=np.where(unexplained, 0.0, terms.low),
        high=np.where(unexplained, limit, terms.high),
    )


def _curve_rows(channels: list[StaticChannel], curve: AllanCurve, terms: NoiseTerms) -> pd.DataFrame:
    c, t = np.indices(curve.deviation.shape).reshape(2, -1)
    explained = (terms.p_value >= UNEXPLAINED_P)[..., None]
    return pd.DataFrame(
        {
            "unit": np.array([channel.unit for channel in channels], dtype=object)[c],
            "axis": np.array([channel.axis for channel in channels], dtype=object)[c],
            "tau_s": curve.tau[t],
            "deviation_ug": curve.deviation.ravel(),
            "low_ug": curve.low.ravel(),
            "high_ug": curve.high.ravel(),
            # the likeliest mixture; NaN for channels that no mixture explains
            "fitted_ug": np.where(explained, model_deviation(terms, curve.tau), np.nan).ravel(),
        }
    )


def _term_rows(channel: StaticChannel, terms: NoiseTerms, index: int) -> list[tuple[object, ...]]:
    rows = list[tuple[object, ...]]()
    for symbol, term in terms.one(index).items():
        value = np.nan if term.value is None else term.value
        note = "; ".join(filter(None, [channel.warmth, remark(channel.digits) if symbol in {"Q", "N"} else ""]))
        text = term.unit.format("µg")
        where = (channel.unit, channel.axis)
        rows.append((*where, symbol, value, term.low, term.high, term.identified, text, note))
        if symbol == "N":
            ends = tuple(np.sqrt(2.0) * end for end in (value, term.low, term.high))
            rows.append((*where, N_ONE_SIDED, *ends, term.identified, "µg/√Hz", note))
    bound = float(terms.bias_instability_bound[index])
    return [*rows, (channel.unit, channel.axis, B_BOUND, np.nan, 0.0, bound, False, "µg", "")]


def _nothing() -> dict[str, pd.DataFrame]:
    return {
        "allan": empty_table(texts="unit axis", numbers="tau_s deviation_ug low_ug high_ug fitted_ug"),
        "noise": empty_table(texts="unit axis term unit_text note", numbers="value low high", flags="identified"),
    }
