"""Shocks as pulses and as waveforms: peak, duration, velocity change and ratio; spectra, and the diagnosis of the comparison."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from inertial.dynamics import pulse_faults, pulses
from inertial.dynamics.pulses import Pulse
from inertial.dynamics.shock_diagnosis import ShockDiagnosis, ShockRecord, Waves, diagnose_shock
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.wander import stated_error
from inertial.errors import NotIdentified
from inertial.record_faults import clipped as at_extreme
from pipelines.procedures.compared import verdict_word
from pipelines.procedures.figures import FigureSpec, FigureValue, diagnosis_texts, with_uncertainty
from pipelines.procedures.recorded import Device, UnitRecord, numbers, point_rows
from schemas.units import STANDARD_GRAVITY_M_S2

DRAWN = 400  # points of a waveform in the picture
PER_PULSE = 40  # samples of the compared waveforms in a duration of the pulse
MOST_SAMPLES = 10_000  # of a compared waveform: they number its points
LEAD, TAIL = 1.5, 6.0  # durations before and after the pulse that are compared
Pair = tuple[tuple[np.ndarray, float], tuple[np.ndarray, float]]


def filtered_pair(reference: UnitRecord, own: UnitRecord, axis: int, scale: float, duration_s: float) -> Pair:
    """Reference and unit along an axis in g, each through the same phaseless low-pass, with their rates."""
    first, second = reference.output[:, axis], own.output[:, axis] / scale
    rate, unit_rate = reference.rate_hz, own.rate_hz
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
    (time, reference), (own, unit) = both
    peak = float(time[int(np.argmax(np.abs(reference(time))))])
    first = max(peak - (0.5 + LEAD) * duration, 0.0)
    last = min(peak + (0.5 + TAIL) * duration, time[-1], own[-1])
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
    """Time before the pulse behind the largest, s, whether one is before the largest, and the rows of both.

    A rebound behind the pulse is left out; one before it lies in the baseline of its figures.
    """
    earlier, later = pulse_faults.other_pulses(drive.output[:, axis], drive.rate_hz, duration)
    rows = [
        {
            "point": MOST_SAMPLES * number + k, "series": "other", "setting": one.at_s, "value": one.peak, "shock": float(number),
        }
        for k, one in enumerate((*earlier, *later))
    ]  # fmt: skip
    end_s = later[0].begins_s - 0.5 * duration if later else np.inf
    return end_s, bool(earlier), rows


def lone_sample(records: Sequence[UnitRecord], axis: int, duration: float) -> float:
    """Time of the first sample of the records that departs alone, s from their begin; nan for none."""
    found = [
        float(one.time[k] - one.time[0])
        for one in records
        for k in pulse_faults.lone_samples(one.output[:, axis], one.rate_hz, duration)[:1]
    ]
    return min(found, default=np.nan)


def verdict(rows: pd.DataFrame, part: Any) -> str:
    """The verdict on the comparison; not judged where the pulses cannot be compared."""
    diagnosis = None
    if comparable(rows):
        with suppress(NotIdentified):
            diagnosis = judged(rows, part)
    return verdict_word(None if diagnosis is None else diagnosis.adequate)


_last_judged: dict[bytes, ShockDiagnosis] = {}
"""The diagnosis that was made last: its sentences and its verdict are asked for one after the other."""


def judged(rows: pd.DataFrame, part: Any) -> ShockDiagnosis | None:
    """The diagnosis of the first shock in each direction; None where no waveforms are kept."""
    kept = rows[rows["series"] == "compared"]
    shocks: list[Waves] = []
    duration = 1e-3 * part.duration_ms
    before, rate = 0.0, PER_PULSE / duration
    for _, one in kept.groupby("direction", sort=False):
        own = one[one["shock"] == one["shock"].iloc[0]]
        reference, unit, error = numbers(own, "reference_g", "value", "uncertainty")
        shocks.append(Waves(reference, unit, error))
        before = -float(own["setting"].iloc[0])
    if not shocks:
        return None
    key = repr((part.effects, rate, duration, before)).encode()
    key += b"".join(array.tobytes() for one in shocks for array in (one.reference, one.unit, one.error))
    if key not in _last_judged:
        made = diagnose_shock(ShockRecord(rate, duration, before, tuple(shocks)), part.effects)
        _last_judged.clear()
        _last_judged[key] = made
    return _last_judged[key]


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


OF_PULSE = (
    FigureSpec("shock_peak_g", "g", "peak of the unit's pulse above its baseline; mean of the shocks", one_axis=True),
    FigureSpec("shock_duration_ms", "ms", "duration of the half sine with the unit's 10 % points", one_axis=True),
    FigureSpec("shock_velocity_m_s", "m/s", "velocity change, the integral over the unit's pulse", one_axis=True),
    FigureSpec(
        "shock_return_ms", "ms", "after the pulse, until the output stays within 2 % of the peak of where it ends"
    ),
    FigureSpec("shock_zero_shift_percent", "%", "output at the end of the record minus the baseline, of the peak"),
)
_COLUMNS = ("value", "duration_s", "velocity_m_s", "return_s", "zero_shift_percent")
_ERRORS = ("uncertainty", "duration_error_s", "velocity_error_m_s", "return_error_s", "zero_shift_error_percent")
_FACTORS = (1.0, 1e3, 1.0, 1e3, 1.0)
APART = 0.3
"""Departure of peak or duration from the reference's above which the two were not mounted on each other."""


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
    flat = [_flat(one, axis, times) for one in channels[: 1 if alone else 2]]
    if len(set(flat)) > 1 or (alone and flat[0]):  # a machine may make a flat pulse, two channels do not clip alike
        clipped = CLIPS.index("the output" if flat[0] else "the reference")
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


CLIPS = ("", "the output", "the reference")
"""What clips, by the column ``clipped``."""


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


def texts_of(reference: pd.DataFrame, pulse: pd.DataFrame, others: pd.DataFrame) -> list[tuple[str, str]]:
    """Peak, duration and velocity change of the reference, or of the unit where it was recorded alone; other pulses."""
    own, name = (reference, "reference") if len(reference) else (pulse, "unit")
    if own.empty:
        return []
    peak, lasting = float(own["value"].abs().mean()), float(own["duration_s"].mean())
    text = (
        f"{name} {peak:.4g} g, {1e3 * lasting:.3g} ms, velocity change {float(own['velocity_m_s'].abs().mean()):.3g} m/s "
        f"(half sine: {pulses.velocity_change(peak, lasting):.3g} m/s; IEC 60068-2-27 allows ± 15 %)"
    )
    of_others = numbers(others, "setting", "value", "shock") if len(others) else ([], [], [])
    found = [
        f"{peak:.3g} g at {at:.4g} s of record {number + 1:.0f}" for at, peak, number in zip(*of_others, strict=True)
    ]
    left_out = f"{', '.join(found)}; the figures are those of the largest pulse, up to the next one"
    return [("pulse", text), *([("another pulse", left_out)] if found else [])]


def comparable(rows: pd.DataFrame) -> bool:
    """Whether a shock has a ratio of two sensors on each other."""
    ratio, reference, pulse = (rows[rows["series"] == name] for name in ("ratio", "reference", "pulse"))
    good = ratio[np.isfinite(ratio["value"])]
    return len(good) > 0 and not no_comparison(good, reference, pulse)


def no_comparison(good: pd.DataFrame, reference: pd.DataFrame, pulse: pd.DataFrame) -> str:
    """Why the pulses of unit and reference are not those of two sensors on each other; empty where they may be."""
    if good.empty or reference.empty or pulse.empty:
        return ""
    peak = float(good["value"].mean())
    lasting = float(pulse["duration_s"].mean()) / float(reference["duration_s"].mean())
    if abs(peak + 1.0) < APART:
        return f"the peak is {peak:.3g} times that of the reference: its sign is turned over; correct the sign of one channel"
    for what, ratio in (("the peak", peak), ("the duration", lasting)):
        if not abs(ratio - 1.0) < APART:
            return (
                f"{what} is {ratio:.3g} times that of the reference: two places of a structure are no comparison; mount the unit "
                "on the reference, or check the scale and the polarity"
            )
    return ""


def ratio_figures(part: Any, ratio: pd.DataFrame, good: pd.DataFrame, apart: str) -> list[FigureValue]:
    """Sensitivity and undershoot by comparison; ``apart``: why there is no comparison."""
    names = ("shock_sensitivity_percent", "shock_undershoot_percent")
    if len(ratio) and "alone" in ratio and bool((ratio["alone"] > 0.0).any()):
        note = "recorded without a reference, which a comparison needs; record one beside the unit"
        return [FigureValue.not_measured(name, part.axis, note) for name in names]
    note = apart or _without(ratio, len(good))
    if note:
        return [FigureValue.not_determined(name, part.axis, note) for name in names]
    _, value, each = numbers(good)
    scatter = float(value.std(ddof=1) / np.sqrt(value.size)) if value.size > 2 else 0.0
    spread = max(scatter, float(np.sqrt(np.mean(each**2)) / np.sqrt(value.size)))
    under = good["undershoot_percent"].to_numpy(dtype=float)
    floor = 100.0 * float(good["noise_g"].mean()) / part.peak_g / np.sqrt(under.size)
    # shocks differ in duration, and so in undershoot: of a few, their scatter is itself uncertain
    scatter = float(under.std(ddof=1) / np.sqrt(under.size)) if under.size > 1 else 0.0
    error = float(np.hypot(100.0 * spread, part.reference_percent))
    under_error = stated_error(floor**2 + scatter**2, 1.0, scatter**2 * np.sqrt(2.0 / max(1, under.size - 1)))
    return [
        FigureValue(names[0], part.axis, float(100.0 * (value.mean() - 1.0)), error),
        FigureValue(names[1], part.axis, float(under.mean()), under_error),
    ]


def _without(ratio: pd.DataFrame, good: int) -> str:
    """Why there is no comparison; empty where every shock has one."""
    if ratio.empty:
        return "0 of 0 shocks show no pulse; check cable and mounting"
    clipped = int((ratio["clipped"] > 0.0).sum())
    if clipped:
        what = CLIPS[int(ratio["clipped"].max())]
        return f"{clipped} of {len(ratio)} shocks clip {what}; lower the peak, or choose a wider range"
    if "earlier" in ratio and bool((ratio["earlier"] > 0.0).any()):
        return (
            "another pulse lies before the largest, in its baseline; give a file that begins after it, or shock again"
        )
    lone = ratio["lone_s"].dropna() if "lone_s" in ratio else ratio["value"].iloc[:0]
    if len(lone):
        return (
            f"{len(lone)} of {len(ratio)} shocks {'has' if len(lone) == 1 else 'have'} a sample that departs alone, at "
            f"{lone.iloc[0]:.6g} s of its record; check the data line, shock again"
        )
    return (
        f"{len(ratio) - good} of {len(ratio)} shocks show no pulse; check cable and mounting"
        if good < len(ratio)
        else ""
    )


def pulse_figures(axis: str, pulse: pd.DataFrame, ratio: pd.DataFrame) -> list[FigureValue]:
    """Peak, duration, velocity change, return and zero shift of the unit, means of the shocks; polarity apart."""
    if pulse.empty or len(pulse) < len(ratio):
        note = _without(ratio, len(pulse)) or "0 shocks show a pulse; check cable and mounting"
        return [FigureValue.not_determined(spec.name, axis, note) for spec in OF_PULSE]
    figures: list[FigureValue] = []
    for spec, column, of_error, factor in zip(OF_PULSE, _COLUMNS, _ERRORS, _FACTORS, strict=True):
        value = factor * numbers(pulse, column)[0]
        value = np.abs(value) if column == "value" else value
        if not np.isfinite(value).all():
            note = "the output does not come to rest; record longer"
            figures.append(FigureValue.not_determined(spec.name, axis, note))
            continue
        each = factor * numbers(pulse, of_error)[0]
        scatter = float(value.std(ddof=1)) if value.size > 1 else 0.0
        error = float(np.hypot(scatter, np.sqrt(np.mean(each**2)))) / np.sqrt(value.size)
        figures.append(FigureValue(spec.name, axis, float(value.mean()), error))
    return figures
