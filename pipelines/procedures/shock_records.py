"""Shocks as pulses and as waveforms: peak, duration, velocity change and ratio; spectra, and the diagnosis of the comparison."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from inertial.dynamics import pulse_faults, pulses
from inertial.dynamics.missing_effects import p_value
from inertial.dynamics.pulses import Pulse
from inertial.dynamics.shock_diagnosis import ShockDiagnosis, ShockRecord, Waves, diagnose_shock
from inertial.dynamics.shock_effects import EFFECTS
from inertial.errors import NotIdentified
from inertial.record_faults import clipped as at_extreme
from pipelines.procedures import shock_figures
from pipelines.procedures.compared import JudgedCurve, reason_of, verdict_word
from pipelines.procedures.figures import diagnosis_texts, with_uncertainty
from pipelines.procedures.recorded import Device, UnitRecord, numbers, point_rows
from schemas.tables import NOT_JUDGED
from schemas.units import STANDARD_GRAVITY_M_S2

DRAWN = 400  # points of a waveform in the picture
PER_PULSE = 40  # samples of the compared waveforms in a duration of the pulse
MOST_SAMPLES = 10_000  # of a compared waveform: they number its points
LEAD, TAIL = 1.5, 6.0  # durations before and after the pulse that are compared
Pair = tuple[tuple[np.ndarray, float], tuple[np.ndarray, float]]


def filtered_pair(reference: UnitRecord, unit: UnitRecord, axis: int, scale: float, duration_s: float) -> Pair:
    """Reference and unit along an axis in g, each through the same phaseless low-pass, with their rates."""
    first, second = reference.output[:, axis], unit.output[:, axis] / scale
    rate, unit_rate = reference.rate_hz, unit.rate_hz
    return (pulses.low_passed(first, rate, duration_s), rate), (
        pulses.low_passed(second, unit_rate, duration_s),
        unit_rate,
    )


def noise_before(pair: Pair, before_s: float) -> float:
    """Standard deviation of the difference of both channels before the pulse, g."""
    quiet = [wave[: int(before_s * rate)] for wave, rate in pair]
    return float(np.hypot(quiet[0].std(ddof=1), quiet[1].std(ddof=1)))


def waves(number: int, pair: Pair, direction: float, part: Any, noise_g: float) -> list[dict[str, Any]]:
    """Both waveforms of a shock on one time base, without the baseline, for the diagnosis.

    Parameters
    ----------
    pair : waveform (n,) in g and rate in Hz of reference and unit, both from the trigger
    part : of the recipe: duration_ms, before_ms, waveform_percent
    """
    duration, before_s = 1e-3 * part.duration_ms, 1e-3 * part.before_ms
    both: list[tuple[np.ndarray, CubicSpline]] = []
    for wave, rate in pair:
        time = np.arange(wave.size) / rate
        both.append((time, CubicSpline(time, wave - wave[: int(before_s * rate)].mean())))
    (time, reference), (unit_time, unit) = both
    peak = float(time[int(np.argmax(np.abs(reference(time))))])
    first = max(peak - (0.5 + LEAD) * duration, 0.0)
    last = min(peak + (0.5 + TAIL) * duration, time[-1], unit_time[-1])
    at = np.arange(first, last, duration / PER_PULSE)
    top = float(np.max(np.abs(reference(at))))
    error = float(np.hypot(noise_g, 1e-2 * part.waveform_percent * top))
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


def until(record: UnitRecord, end_s: float) -> UnitRecord:
    """A record up to a time from its begin, s."""
    count = min(len(record.time), max(int(end_s * record.rate_hz), 1)) if np.isfinite(end_s) else len(record.time)
    return UnitRecord(record.time[:count], record.output[:count])


def single_pulse(
    number: int, drive: UnitRecord, axis: int, duration: float
) -> tuple[float, bool, list[dict[str, Any]]]:
    """Time before the pulse behind the largest, s, whether a pulse is before the largest, and the rows of both.

    A rebound behind the pulse is left out; a pulse before it lies in the baseline of its figures.
    """
    earlier, later = pulse_faults.other_pulses(drive.output[:, axis], drive.rate_hz, duration)
    rows = [
        {
            "point": MOST_SAMPLES * number + k, "series": "other", "setting": pulse.at_s, "value": pulse.peak,
            "shock": float(number),
        }
        for k, pulse in enumerate((*earlier, *later))
    ]  # fmt: skip
    end_s = later[0].begins_s - 0.5 * duration if later else np.inf
    return end_s, bool(earlier), rows


def lone_sample(records: Sequence[UnitRecord], axis: int, duration: float) -> float:
    """Time of the first sample of the records that departs alone, s from their begin; nan for none."""
    found = [
        float(channel.time[k] - channel.time[0])
        for channel in records
        for k in pulse_faults.lone_samples(channel.output[:, axis], channel.rate_hz, duration)[:1]
    ]
    return min(found, default=np.nan)


def verdict(rows: pd.DataFrame, part: Any) -> str:
    """The verdict on the comparison; not judged where the pulses cannot be compared."""
    diagnosis = None
    if shock_figures.comparable(rows):
        with suppress(NotIdentified):
            diagnosis = judged(rows, part)
    return verdict_word(None if diagnosis is None else diagnosis.adequate)


_last_judged: dict[bytes, ShockDiagnosis] = {}
"""The diagnosis that was made last: its sentences and its verdict are asked for one after the other."""


def judged(rows: pd.DataFrame, part: Any) -> ShockDiagnosis | None:
    """The diagnosis of the first shock in each direction; None where the points have no waveforms."""
    waveforms = rows[rows["series"] == "compared"]
    shocks: list[Waves] = []
    duration = 1e-3 * part.duration_ms
    before, rate = 0.0, PER_PULSE / duration
    for _, shock in waveforms.groupby("direction", sort=False):
        first = shock[shock["shock"] == shock["shock"].iloc[0]]
        reference, unit, error = numbers(first, "reference_g", "value", "uncertainty")
        shocks.append(Waves(reference, unit, error))
        before = -float(first["setting"].iloc[0])
    if not shocks:
        return None
    key = repr((part.effects, rate, duration, before)).encode()
    key += b"".join(array.tobytes() for shock in shocks for array in (shock.reference, shock.unit, shock.error))
    if key not in _last_judged:
        made = diagnose_shock(ShockRecord(rate, duration, before, tuple(shocks)), part.effects)
        _last_judged.clear()
        _last_judged[key] = made
    return _last_judged[key]


def judged_curves(rows: pd.DataFrame, part: Any) -> list[JudgedCurve]:
    """The model of the waveforms with its verdict, which a certificate rests on; none where the points have no waveforms."""
    try:
        diagnosis = judged(rows, part)
    except NotIdentified as problem:
        return [JudgedCurve(part.axis, "of the waveforms", NOT_JUDGED, np.nan, str(problem))]
    if diagnosis is None:
        return []
    model = " + ".join(("sensitivity", *diagnosis.fit.effects))
    verdict = verdict_word(diagnosis.adequate)
    return [JudgedCurve(part.axis, model, verdict, p_value(diagnosis.fit), reason_of(diagnosis))]


def diagnosis_text(rows: pd.DataFrame, part: Any) -> list[tuple[str, str]]:
    """The diagnosis in sentences: subject and text."""
    try:
        diagnosis = judged(rows, part)
    except NotIdentified as problem:
        return [("comparison of the waveforms", f"cannot be judged: {problem}")]
    if diagnosis is None:
        return []
    misfit = f"; {100.0 * diagnosis.where[1]:.0f} % of χ² is in the samples of {diagnosis.where[0]}"

    def size(name: str) -> str:
        effect, fit = EFFECTS[name], diagnosis.extended
        parameters = effect.parameters(1e-3 * part.duration_ms)
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
        f = pulses.octave_frequencies(0.1 / duration, min(10.0 / duration, 0.08 * rate))
        for series, x, value in (
            ("wave", t[::step] - t[0], y[inside][::step]),
            ("spectrum", f, pulses.shock_spectrum(y, rate, f)),
        ):
            point = np.arange(x.size)
            rows += point_rows(series=f"{series}_{name}", point=point, setting=x, value=value, uncertainty=np.nan)
    return rows


class Found(NamedTuple):
    """Whether a shock has no reference, time of a sample that departs alone (nan: none), whether a pulse precedes the largest."""

    alone: bool
    lone_s: float
    earlier: bool


def rows_of(
    number: int,
    direction: float,
    channels: tuple[UnitRecord, UnitRecord],
    axis: int,
    pair: Pair,
    times: tuple[float, float],
    device: Device,
    found: Found,
) -> list[dict[str, Any]]:
    """The pulses of reference and unit and their ratio; no value where the unit shows no pulse or clips, or a sample is off.

    Parameters
    ----------
    channels : unit and reference as recorded; pair : reference and unit in g behind their low-pass
    times : before the pulse, and its duration, s
    found : in the records; without a reference the first of the pair is not looked at
    """
    alone, lone_s, earlier = found
    ((reference, rate), (unit, unit_rate)), before_s = pair, times[0]
    about = {"point": number, "setting": direction}
    rows: list[dict[str, Any]] = []
    drive = None if alone else pulses.measured_pulse(reference, rate, before_s=before_s)
    if drive is not None:
        rows.append(about | {"series": "reference"} | _columns(drive, reference, rate))
    raw = channels[0].output[:, axis]
    still = np.median(raw[: int(before_s * unit_rate)])
    # a rail of the unit itself, below the range of the data sheet, shows as an extreme at which it stands still
    clipped = device.at_end(raw) + device.at_end(raw - still) + at_extreme(raw)[2] > 0
    flat = [_flat(channel, axis, times) for channel in channels[: 1 if alone else 2]]
    if len(set(flat)) > 1 or (alone and flat[0]):  # a machine may make a flat pulse, two channels do not clip alike
        clipped = shock_figures.CLIPS.index("the output" if flat[0] else "the reference")
    ratio = error = under = noise = np.nan
    with suppress(NotIdentified):
        if not clipped and np.isnan(lone_s) and not earlier:
            answer = pulses.measured_pulse(unit, unit_rate, before_s=before_s)
            noise = answer.noise
            rows.append(about | {"series": "pulse"} | _columns(answer, unit, unit_rate))
            if drive is not None:
                ratio = answer.peak / drive.peak
                error = abs(ratio) * float(np.hypot(answer.peak_error / answer.peak, drive.peak_error / drive.peak))
                under = 100.0 * (answer.undershoot - drive.undershoot)
    compared = {"value": ratio, "uncertainty": error, "undershoot_percent": under, "noise_g": noise, "lone_s": lone_s}
    flags = {"clipped": float(clipped), "alone": float(alone), "earlier": float(earlier)}
    return [*rows, about | {"series": "ratio"} | flags | compared]


def _flat(record: UnitRecord, axis: int, times: tuple[float, float]) -> bool:
    """Whether the top of a channel's pulse is cut off flat."""
    wave, (before_s, duration) = record.output[:, axis], times
    quiet = wave[: int(before_s * record.rate_hz)]
    if quiet.size < 2:
        return False
    return pulse_faults.flat_top(wave, record.rate_hz, duration, float(quiet.std(ddof=1)), float(quiet.mean())) > 0


def _columns(pulse: Pulse, wave: np.ndarray, rate_hz: float) -> dict[str, float]:
    shift, error = pulses.zero_shift(wave, pulse)
    between = 1.0 / rate_hz / np.sqrt(12.0)  # rectangular, over the interval of the samples
    share = float(np.hypot(pulse.peak_error / pulse.peak, np.sqrt(2.0) * between / pulse.duration_s))
    return {
        "duration_error_s": np.sqrt(2.0) * between,
        "velocity_error_m_s": share * pulse.velocity * STANDARD_GRAVITY_M_S2,
        "return_error_s": between,
        "value": pulse.peak,
        "uncertainty": pulse.peak_error,
        "duration_s": pulse.duration_s,
        "velocity_m_s": pulse.velocity * STANDARD_GRAVITY_M_S2,
        "return_s": pulses.return_time(wave, pulse, rate_hz),
        "zero_shift_percent": 100.0 * shift / pulse.peak,
        "zero_shift_error_percent": 100.0 * error / abs(pulse.peak),
    }
