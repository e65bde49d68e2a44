"""Documents of noise: Allan deviation with its terms, another statistic, the spectrum; of a series or a captured run."""

from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.disturbances import disturbance_texts, disturbances
from inertial.noise import terms as noise_terms
from inertial.noise.allan import CONFIDENCE, overlapping
from inertial.noise.navigation import TIMES_S, TO_M_S2, navigation_error
from inertial.noise.psd import Spectrum, allan_variance, one_sided, spectral_lines
from inertial.noise.terms import NAMES, NoiseTerms, fit_terms, model_deviation
from pipelines.archive import Run
from pipelines.chain.documents import NavigationRow
from pipelines.importers.series import EvenSeries
from pipelines.stages.noise import (
    FEWEST,
    UNEXPLAINED_P,
    alike,
    limits_where_unexplained,
    static_record,
    without_disturbed,
)
from pipelines.stages.static_record import Coarse, Digits, remark, without_digits
from pipelines.tables.frames import rows_of
from schemas.errors import DataRejected, WrongUse

SHORTEST_SEGMENT = 64
SHORTEST_TAU = 8
"""Samples of the shortest averaging time from the spectrum: what lies above half the sampling rate is missing in it."""
LONGEST_TAU = 8
"""Parts of a segment that the longest averaging time from the spectrum is: slower is not resolved."""

CURVE = {"tau_s": "tau_s", "deviation": "deviation_ug", "low": "low_ug", "high": "high_ug"}
"""Columns of the table ``allan`` by the key of the document."""
ALLAN = {"statistic": "allan", "statistic_name": "overlapping Allan deviation"}


def allan_document(series: EvenSeries, spacing: str = "octave", statistic: str = "allan") -> dict[str, Any]:
    """Curves and terms of every channel of a series.

    Raises
    ------
    DataRejected
        The record is too short, or no channel changes.
    """
    n = series.values.shape[1]
    if n < FEWEST:
        raise DataRejected(f"{series.where}: {n} samples, {FEWEST} are needed for five terms; record longer")
    alive = [k for k in range(len(series.names)) if np.ptp(series.values[k]) > 0.0]
    if not alive:
        raise DataRejected(
            f"{series.where}: no channel ever changes, noise is needed; check the channels and the digits"
        )
    curve = overlapping(series.values[alive], series.rate_hz, "decade" if spacing == "decade" else "octave")
    disturbed = [disturbances(series.values[k]) for k in alive]
    fitted = without_disturbed(fit_terms(curve), disturbed)
    coarse = [_coarse(series.values[k]) for k in alive]
    terms = without_digits(limits_where_unexplained(curve, fitted), coarse, series.rate_hz)
    explained = fitted.p_value >= UNEXPLAINED_P
    names = [series.names[k] for k in alive]
    found_texts = [disturbance_texts(found, series.rate_hz, series.unit) for found in disturbed]
    notes = [series.recognised] if series.recognised else []
    notes += [f"{series.names[k]}: the output never changes" for k in range(len(series.names)) if k not in alive]
    notes += [
        f"{name}: {text}"
        for name, digits in zip(names, coarse, strict=True)
        if (text := remark(digits, series.unit or "of the output's unit"))
    ]
    notes += [
        f"{name}: {', '.join(texts) if texts else 'no mixture of the five terms explains the curve'}"
        f"{'' if known else '; the limits are what the whole curve allows'}"
        for name, known, texts in zip(names, explained, found_texts, strict=True)
        if texts or not known
    ]
    shown, unit, about, model = curve, series.unit, ALLAN, model_deviation(terms, curve.tau)
    if statistic != ALLAN["statistic"]:
        from pipelines.stages.deviations import STATISTICS, deviations

        kind = STATISTICS[statistic]
        shown = deviations(kind, series.values[alive], series.unit, curve, fitted, explained=explained)
        unit, about, model = shown.unit, {"statistic": statistic, "statistic_name": kind.name}, None
    return {
        "source": series.where,
        "unit": series.unit,
        "rate_hz": series.rate_hz,
        "samples": n,
        **about,
        "deviation_unit": unit,
        "confidence": CONFIDENCE,
        "term_confidence": noise_terms.CONFIDENCE,
        "curves": [
            {
                "channel": name,
                "tau_s": shown.tau.tolist(),
                "deviation": shown.deviation[k].tolist(),
                "low": shown.low[k].tolist(),
                "high": shown.high[k].tolist(),
                "fitted": model[k].tolist() if model is not None and explained[k] else None,
            }
            for k, name in enumerate(names)
        ],
        "terms": (rows := [row for k, name in enumerate(names) for row in _term_rows(name, terms, k, series.unit)]),
        "navigation": _navigation_rows(rows, series.unit),
        "disturbances": [
            {
                "channel": name, "kind": event.kind, "start_s": event.start / series.rate_hz,
                "stop_s": event.stop / series.rate_hz, "count": event.count, "size": event.size,
            }
            for name, found in zip(names, disturbed, strict=True) for event in found
        ],
        "notes": notes,
    }  # fmt: skip


def _coarse(values: Array) -> Coarse:
    """The digits of a channel (n,)."""
    digits = Digits()
    digits.add(values)
    return Coarse.of(digits, 1.0)


def _navigation_rows(terms: list[dict[str, Any]], unit: str) -> list[NavigationRow]:
    """The errors of navigation of every channel with an identified term, in SI; none where the output is no acceleration."""
    if unit not in TO_M_S2:
        return []
    by_channel: dict[str, dict[str, float | None]] = {}
    for row in terms:
        by_channel.setdefault(row["channel"], {})[row["term"]] = row["value"] if row["identified"] else None
    made: list[NavigationRow] = []
    for channel, values in by_channel.items():
        if all(values.get(name) is None for name in "NBK"):
            continue
        error = navigation_error(values, unit, np.array(TIMES_S))
        made.append(
            {
                "channel": channel,
                "velocity_random_walk_m_s_rth": error.velocity_random_walk,
                "q_n_m2_s4_Hz": error.q_n,
                "q_b_m2_s4": error.q_b,
                "not_identified": [name for name in "NBK" if values.get(name) is None],
                "time_s": list(TIMES_S),
                "velocity_m_s": error.velocity.tolist(),
                "position_m": error.position.tolist(),
            }
        )
    return made


def _term_rows(channel: str, terms: NoiseTerms, index: int, unit: str) -> list[dict[str, Any]]:
    return [
        {
            "channel": channel, "term": symbol, "name": term.name, "value": term.value, "low": term.low,
            "high": term.high, "identified": term.identified, "unit": term.unit.format(unit or "unit"),
        }
        for symbol, term in terms.one(index).items()
    ]  # fmt: skip


def allan_of_run(run: Run) -> dict[str, Any]:
    """Curves and terms that a captured run has of its static record, in µg, the channels named unit and axis.

    Raises
    ------
    WrongUse
        The run has none.
    """
    if not {"allan", "noise"} <= set(run.tables()) or run.table("allan").empty:
        raise WrongUse(
            f"run {run.id}: it has no static record, one is needed; run a recipe with static_record_s above 0"
        )
    curves, noise = run.table("allan"), run.table("noise")
    readings = run.table("readings")
    static = readings[readings["kind"] == "allan"]
    channels = []
    for (unit, axis), points in curves.groupby(["unit", "axis"], sort=False):
        curve = {name: points[column].tolist() for name, column in CURVE.items()}
        fitted = points["fitted_ug"].tolist() if points["fitted_ug"].notna().all() else None
        channels.append({"channel": f"{unit} {axis}", **curve, "fitted": fitted})
    rows = [
        {
            "channel": f"{row['unit']} {row['axis']}", "term": row["term"], "name": NAMES[row["term"]],
            "value": row["value"] if row["identified"] else None, "low": row["low"], "high": row["high"],
            "identified": bool(row["identified"]), "unit": row["unit_text"],
        }
        for row in rows_of(noise) if row["term"] in NAMES
    ]  # fmt: skip
    notes = list(dict.fromkeys(f"{r['unit']} {r['axis']}: {r['note']}" for r in rows_of(noise) if r.get("note")))
    return {
        "source": f"run {run.id}",
        "unit": "µg",
        "rate_hz": float(static["rate_hz"].iloc[0]),
        "samples": int(static["n"].max()),
        **ALLAN,
        "deviation_unit": "µg",
        "confidence": CONFIDENCE,
        "term_confidence": noise_terms.CONFIDENCE,
        "curves": channels,
        "terms": rows,
        "navigation": _navigation_rows(rows, "µg"),
        "notes": notes,
    }


def statistic_of_run(run: Run, spacing: str, statistic: str) -> dict[str, Any]:
    """Another statistic of the static record of a captured run, made from its samples; the terms are those of the run.

    Raises
    ------
    WrongUse
        The run has no static record.
    """
    document = allan_of_run(run)
    from pipelines.chain.chain import static_inputs  # loads every stage, which a file does not need

    record = static_record(*static_inputs(run))
    assert record is not None
    parts = [
        allan_document(
            EvenSeries(
                tuple(f"{channel.unit} {channel.axis}" for channel in channels),
                np.stack([channel.record for channel in channels]),
                record.rate_hz / record.size,
                "µg",
                document["source"],
            ),
            spacing,
            statistic,
        )
        for channels in alike(record.channels)
    ]
    if record.size > 1:
        document["notes"].append(f"the record is averaged over {record.size} samples before the statistic is made")
    shown = {key: parts[0][key] for key in ("statistic", "statistic_name", "deviation_unit")}
    return {**document, **shown, "curves": [curve for part in parts for curve in part["curves"]]}


def psd_document(series: EvenSeries, segment: int | None = None) -> dict[str, Any]:
    """Spectra of every channel of a series, and σ(τ) from them and from the samples.

    Raises
    ------
    DataRejected
        The record is too short for a segment.
    """
    n = series.values.shape[1]
    length = n // 8 if segment is None else segment
    if not SHORTEST_SEGMENT <= length <= n:
        raise DataRejected(
            f"{series.where}: segments of {length} samples in a record of {n}, {SHORTEST_SEGMENT} to {n} are possible; "
            f"{'record longer' if segment is None else 'correct --segment'}"
        )
    spectrum = one_sided(series.values, series.rate_hz, segment=length)
    m = SHORTEST_TAU * 2 ** np.arange(int(np.log2(max(length // LONGEST_TAU // SHORTEST_TAU, 1))) + 1)
    m = m[2 * m <= n - 1]
    direct = overlapping(series.values, series.rate_hz, m)
    # the segment's mean is taken out: its zero frequency says nothing
    density = spectrum.density.copy()
    density[..., 0] = density[..., 1]
    derived = np.sqrt(allan_variance(spectrum.frequency, density, direct.tau))
    rows = [
        {
            "channel": name,
            "density": spectrum.density[k].tolist(),
            "median_amplitude": float(np.median(spectrum.amplitude[k, 1:])),
            "tau_s": direct.tau.tolist(),
            "deviation_from_density": derived[k].tolist(),
            "deviation": direct.deviation[k].tolist(),
        }
        for k, name in enumerate(series.names)
    ]
    return {
        "source": series.where,
        "unit": series.unit,
        "rate_hz": series.rate_hz,
        "samples": n,
        "segment": length,
        "frequency_hz": spectrum.frequency.tolist(),
        "spectra": rows,
        "notes": [
            *filter(None, [series.recognised]),
            *(
                f"{name}: {', '.join(texts)}"
                for name, values in zip(series.names, series.values, strict=True)
                if (texts := disturbance_texts(disturbances(values), series.rate_hz, series.unit))
            ),
            *(
                f"{name}: a line at {frequency:.5g} Hz, {rms:.3g} {series.unit} rms".rstrip()
                for k, name in enumerate(series.names)
                for frequency, rms in spectral_lines(Spectrum(spectrum.frequency, spectrum.density[k]), n)
            ),
        ],
    }
