"""Waveforms of a shock: for the picture, the shock response spectrum, and the diagnosis of their comparison."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from inertial.dynamics.pulses import low_passed, octave_frequencies, shock_spectrum
from inertial.dynamics.shock_diagnosis import ShockDiagnosis, diagnose_shock
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.shock_fit import ShockRecord, Waves
from inertial.errors import NotIdentified
from pipelines.procedures.columns import numbers, point_rows
from pipelines.procedures.recorded import UnitRecord
from pipelines.procedures.wording import diagnosis_texts, with_uncertainty

DRAWN = 400  # points of a waveform in the picture
PER_PULSE = 40  # samples of the compared waveforms in a duration of the pulse
MOST_SAMPLES = 10_000  # of a compared waveform: they number its points
LEAD, TAIL = 1.5, 6.0  # durations before and after the pulse that are compared
Pair = tuple[tuple[np.ndarray, float], tuple[np.ndarray, float]]


class WaveSettings(NamedTuple):
    """Nominal duration of the pulse, s; time that is free of it, s; standard uncertainty of a sample, % of the peak."""

    duration_s: float
    before_s: float
    floor_percent: float


def filtered_pair(reference: UnitRecord, own: UnitRecord, axis: int, scale: float, duration_s: float) -> Pair:
    """Reference and unit along an axis in g, each through the same phaseless low-pass, with their rates."""
    both = (reference.output[:, axis], reference.rate_hz), (own.output[:, axis] / scale, own.rate_hz)
    (first, rate), (second, unit_rate) = both
    return (low_passed(first, rate, duration_s), rate), (low_passed(second, unit_rate, duration_s), unit_rate)


def noise_before(pair: Pair, before_s: float) -> float:
    """Standard deviation of the difference of both channels before the pulse, g."""
    quiet = [wave[: int(before_s * rate)] for wave, rate in pair]
    return float(np.hypot(quiet[0].std(ddof=1), quiet[1].std(ddof=1)))


def waves(number: int, pair: Pair, direction: float, settings: WaveSettings, noise_g: float) -> list[dict[str, Any]]:
    """Both waveforms of a shock on one time base, without the baseline, for the diagnosis.

    Parameters
    ----------
    pair : waveform (n,) in g and rate in Hz of reference and unit, both from the trigger
    """
    duration = settings.duration_s
    both: list[tuple[np.ndarray, CubicSpline]] = []
    for wave, rate in pair:
        time = np.arange(wave.size) / rate
        both.append((time, CubicSpline(time, wave - wave[: int(settings.before_s * rate)].mean())))
    (time, reference), (own, unit) = both
    peak = float(time[int(np.argmax(np.abs(reference(time))))])
    first = max(peak - (0.5 + LEAD) * duration, 0.0)
    last = min(peak + (0.5 + TAIL) * duration, time[-1], own[-1])
    at = np.arange(first, last, duration / PER_PULSE)
    top = float(np.max(np.abs(reference(at))))
    error = float(np.hypot(noise_g, 1e-2 * settings.floor_percent * top))
    return point_rows(
        series="compared",
        point=MOST_SAMPLES * number + np.arange(at.size),
        setting=at - peak + 0.5 * duration,
        value=unit(at),
        uncertainty=error,
        reference_g=reference(at),
        direction=direction,
        shock=float(number),
    )


def judged(rows: pd.DataFrame, settings: WaveSettings, effects: Sequence[str]) -> ShockDiagnosis | None:
    """The diagnosis of the first shock in each direction; None where no waveforms are kept."""
    kept = rows[rows["series"] == "compared"]
    shocks: list[Waves] = []
    before, rate = 0.0, PER_PULSE / settings.duration_s
    for _, one in kept.groupby("direction", sort=False):
        own = one[one["shock"] == one["shock"].iloc[0]]
        reference, unit, error = numbers(own, "reference_g", "value", "uncertainty")
        shocks.append(Waves(reference, unit, error))
        before = -float(own["setting"].iloc[0])
    return diagnose_shock(ShockRecord(rate, settings.duration_s, before, tuple(shocks)), effects) if shocks else None


def diagnosis_text(rows: pd.DataFrame, settings: WaveSettings, effects: Sequence[str]) -> list[tuple[str, str]]:
    """The diagnosis in sentences: subject and text."""
    try:
        diagnosis = judged(rows, settings, effects)
    except NotIdentified as problem:
        return [("comparison of the waveforms", f"cannot be judged: {problem}")]
    if diagnosis is None:
        return []
    misfit = f"; {100.0 * diagnosis.where[1]:.0f} % of χ² is in the samples of {diagnosis.where[0]}"

    def size(name: str) -> str:
        effect, fit = EFFECTS[name], diagnosis.extended
        parameters = effect.parameters(settings.duration_s)
        value, error = fit.coefficients[name] if name in fit.coefficients else fit.parameters[parameters[0].name]
        return f"{with_uncertainty(value, 2.0 * error)} {effect.unit} (k = 2)"

    return diagnosis_texts(
        diagnosis,
        "comparison of the waveforms",
        ("sensitivity",),
        size,
        (f"{diagnosis.error_percent:.2g}", f"{diagnosis.extended_percent:.2g}", "% of the peak"),
        ("samples", "the shocks"),
        "the difference of the waveforms; look at mounting and cable",
        "" if diagnosis.adequate else misfit,
    )


def curves(pair: Pair, names: Sequence[str], duration: float, before_s: float) -> list[dict[str, Any]]:
    """Waveforms and shock response spectra of one shock, thinned for the picture."""
    rows: list[dict[str, Any]] = []
    for name, (wave, rate) in zip(names, pair[-len(names) :], strict=True):
        y = wave - wave[: int(before_s * rate)].mean()
        middle = int(np.argmax(np.abs(y)))
        inside = slice(max(0, middle - int(2.0 * duration * rate)), middle + int(3.0 * duration * rate))
        t = (np.arange(y.size) / rate)[inside]
        step = max(1, t.size // DRAWN)
        f = octave_frequencies(0.1 / duration, min(10.0 / duration, 0.08 * rate))
        for series, x, value in (
            ("wave", t[::step] - t[0], y[inside][::step]),
            ("spectrum", f, shock_spectrum(y, rate, f)),
        ):
            point = np.arange(x.size)
            rows += point_rows(series=f"{series}_{name}", point=point, setting=x, value=value, uncertainty=np.nan)
    return rows
