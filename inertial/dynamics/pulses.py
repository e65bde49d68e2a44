"""Shock pulses: peak, duration, baseline and velocity change of a recorded pulse, and its response spectrum (ISO 18431-4)."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter, sosfiltfilt

from inertial.arrays import NORMAL_MEDIAN, Array
from inertial.dynamics.spectra import STANDARD_GRAVITY
from inertial.errors import NotIdentified

TEN_PERCENT = 1.0 - 2.0 * float(np.arcsin(0.1)) / np.pi
"""0.936: part of a half sine's duration between its 10 % points."""
TOP = 0.9  # of the largest sample: the part of the pulse through which the parabola is laid


def velocity_change(peak_g: float, duration_s: float) -> float:
    """Velocity change of a half sine in m/s: 2AD/π."""
    return 2.0 * peak_g * STANDARD_GRAVITY * duration_s / np.pi


@dataclass(frozen=True)
class Pulse:
    """What a recorded pulse is. ``peak`` carries the sign of the pulse; the other figures are magnitudes.

    peak, peak_error : above the baseline, and its standard uncertainty; unit of the record
    duration_s : of the half sine with these 10 % points
    velocity : integral over the pulse, unit of the record times s
    baseline : mean before the pulse
    noise : standard deviation of a sample before the pulse
    undershoot : largest excursion against the pulse after it, as a share of the peak
    start, stop : first and last sample of the pulse
    """

    peak: float
    peak_error: float
    duration_s: float
    velocity: float
    baseline: float
    noise: float
    undershoot: float
    start: int
    stop: int


def measured_pulse(record: Array, rate_hz: float, *, before_s: float) -> Pulse:
    """Peak, duration, velocity change and undershoot of a recorded half sine.

    The baseline is the mean before the pulse: a sensor that measures gravity is not at zero there. The peak is the vertex of a
    parabola through the top tenth, since the largest sample is biased by noise. Only the pulse is integrated.

    Parameters
    ----------
    record : (n,), any unit
    before_s : time at the beginning of the record that is free of the pulse, s

    Raises
    ------
    NotIdentified
        No pulse stands out of the noise, or its ends lie outside the record.
    """
    quiet = record[: int(before_s * rate_hz)]
    if quiet.size < 8:
        raise NotIdentified(
            f"shock: {quiet.size} samples before the pulse, 8 or more are needed for the baseline; begin the record earlier"
        )
    baseline, noise = float(quiet.mean()), float(quiet.std(ddof=1))
    y = record - baseline
    sign = 1.0 if y.max() >= -y.min() else -1.0
    y = sign * y
    top = int(np.argmax(y))
    if not y[top] > 8.0 * noise:
        raise NotIdentified(
            f"shock: the largest excursion is {y[top]:.3g}, {8.0 * noise:.3g} is needed above a noise of "
            f"{noise:.3g}; check the trigger"
        )
    low, high = span(y, top, TOP * y[top])
    samples = np.arange(low, high + 1)
    if samples.size < 5:
        raise NotIdentified(
            f"shock: {samples.size} samples in the top tenth of the pulse, 5 or more are needed; sample faster"
        )
    x = (samples - samples.mean()) / rate_hz
    rows = np.column_stack([np.ones_like(x), x, x**2])
    c = np.linalg.lstsq(rows, y[samples], rcond=None)[0]
    at = float(np.clip(-0.5 * c[1] / c[2], x[0], x[-1])) if c[2] < 0.0 else 0.0
    value = float(c[0] + c[1] * at + c[2] * at**2)
    covariance = np.linalg.inv(rows.T @ rows) * noise**2
    vertex = np.array([1.0, at, at**2])
    start, stop = _crossings(y, top, 0.1 * value)
    if start < 1 or stop > y.size - 2:
        raise NotIdentified("shock: the pulse is cut off at an end of the record; move the trigger, or record longer")
    duration = (stop - start) / rate_hz / TEN_PERCENT
    pad = 0.5 * (1.0 - TEN_PERCENT) * duration * rate_hz
    first, last = max(0, round(start - pad)), min(y.size - 1, round(stop + pad))
    after = y[last:]
    return Pulse(
        peak=sign * value,
        peak_error=float(np.sqrt(vertex @ covariance @ vertex)),
        duration_s=duration,
        velocity=float(np.trapezoid(y[first : last + 1]) / rate_hz),
        baseline=baseline,
        noise=noise,
        undershoot=max(0.0, float(-after.min()) / value) if after.size else 0.0,
        start=first,
        stop=last,
    )


HALF_WIDTH = 2.0 / 3.0
"""Part of a half sine's duration between the points at half of its peak."""
CUT = 6.0
"""Corner of the low-pass behind which a pulse is measured, over its duration: it takes 0.3 % off a half sine."""
_ALIKE = 0.15
_SETTLED = 0.02


def low_passed(record: Array, rate_hz: float, duration_s: float) -> Array:
    """A record (n,) behind the phaseless low-pass that belongs to a pulse of this duration."""
    corner = min(CUT / duration_s, 0.4 * rate_hz)
    return np.asarray(sosfiltfilt(butter(2, corner, fs=rate_hz, output="sos"), record))


def found_duration(record: Array, rate_hz: float) -> tuple[float, float]:
    """Duration of the half sine in a record (n,) of any unit, s, and the time at the beginning that is free of it, s.

    The width at half of the peak decides the low-pass, which decides the width: from the narrowest excursion on until both agree,
    so that neither ringing nor a filter for another pulse is taken for the pulse.

    Raises
    ------
    NotIdentified
        No pulse stands out of the noise, it begins with the record, or its widths at 10 and at 50 % are not those of a half sine.
    """
    plain = record - np.median(record)
    noise = float(np.median(np.abs(plain))) / NORMAL_MEDIAN
    y, duration = plain, 0.0
    for _ in range(30):
        y = y if y[np.argmax(np.abs(y))] > 0.0 else -y
        top = int(np.argmax(y))
        if not y[top] > 8.0 * noise:
            raise NotIdentified(
                f"shock: the largest excursion is {y[top]:.3g} at a noise of {noise:.3g}, no pulse; check the trigger"
            )
        start, stop = _crossings(y, top, 0.5 * float(y[top]))
        wider = max((stop - start) / rate_hz / HALF_WIDTH, 4.0 / rate_hz)
        if abs(wider - duration) < _SETTLED * wider:
            break
        duration = wider
        y = low_passed(plain, rate_hz, duration)
    top = int(np.argmax(y))
    start, stop = _crossings(y, top, 0.1 * float(y[top]))
    by_foot = (stop - start) / rate_hz / TEN_PERCENT
    if abs(by_foot / duration - 1.0) > _ALIKE:
        raise NotIdentified(
            f"shock: the pulse is no half sine: by its width at 10 % of the peak it lasts {1e3 * by_foot:.3g} ms, at 50 % "
            f"{1e3 * duration:.3g} ms, with {duration * rate_hz:.0f} samples; look at the mounting, or sample faster"
        )
    return by_foot, max(start / rate_hz - 0.5 * by_foot, 0.0)


def return_time(record: Array, pulse: "Pulse", rate_hz: float, share: float = 0.02) -> float:
    """Time after the pulse, s, until the record stays within a share of the peak of where it ends; NaN where it does not."""
    after = record[pulse.stop :]
    rest = after[-max(after.size // 5, 8) :]
    allowed = max(share * abs(pulse.peak), 4.0 * pulse.noise)
    if after.size < 40 or float(np.ptp(rest)) > 2.0 * allowed:
        return float("nan")
    beyond = np.flatnonzero(np.abs(after - rest.mean()) > allowed)
    return (int(beyond[-1]) + 1) / rate_hz if beyond.size else 0.0


def zero_shift(record: Array, pulse: "Pulse") -> tuple[float, float]:
    """Mean of the last fifth after the pulse minus the baseline, and its standard uncertainty by white noise."""
    after = record[pulse.stop :]
    rest = after[-max(after.size // 5, 8) :]
    before = max(pulse.start // 2, 8)
    return float(rest.mean()) - pulse.baseline, pulse.noise * float(np.sqrt(1.0 / rest.size + 1.0 / before))


def span(y: Array, top: int, level: float) -> tuple[int, int]:
    """First and last sample of the run around ``top`` that stays above a level."""
    low = high = top
    while low > 0 and y[low - 1] >= level:
        low -= 1
    while high < y.size - 1 and y[high + 1] >= level:
        high += 1
    return low, high


def _crossings(y: Array, top: int, level: float) -> tuple[float, float]:
    """Interpolated times, in samples, at which the pulse crosses a level before and after ``top``."""
    low, high = span(y, top, level)
    start, stop = float(low), float(high)
    if low > 0 and y[low] > y[low - 1]:
        start = low - (y[low] - level) / (y[low] - y[low - 1])
    if high < y.size - 1 and y[high] > y[high + 1]:
        stop = high + (y[high] - level) / (y[high] - y[high + 1])
    return start, stop


PER_OCTAVE = 12
FEWEST_PER_PERIOD = 10.0


def octave_frequencies(low_hz: float, high_hz: float) -> Array:
    """Frequencies (n,) in Hz from low to at most high, twelve in an octave."""
    count = int(np.floor(PER_OCTAVE * np.log2(high_hz / low_hz) + 1e-9)) + 1
    return low_hz * 2.0 ** (np.arange(count) / PER_OCTAVE)


def responses(record: Array, rate_hz: float, natural_hz: float, q: float) -> Array:
    """Absolute acceleration (n,) of a base-excited oscillator with this natural frequency and Q (``inf``: undamped).

    ISO 18431-4: the ramp-invariant recursion after Smallwood.
    """
    damping = 0.0 if np.isinf(q) else 0.5 / q
    wn, t = 2.0 * np.pi * natural_hz, 1.0 / rate_hz
    wd = wn * np.sqrt(1.0 - damping**2)
    e, k = np.exp(-damping * wn * t), wd * t
    c, s = e * np.cos(k), e * np.sin(k)
    sp = s / k
    return np.asarray(lfilter([1.0 - sp, 2.0 * (sp - c), e**2 - sp], [1.0, -2.0 * c, e**2], record), dtype=np.float64)


def shock_spectrum(record: Array, rate_hz: float, natural_hz: Array, q: float = 10.0) -> Array:
    """Largest absolute response (m,), the maximax spectrum, in the record's unit.

    One period of the lowest frequency of zeros is added behind the record, so that the residual response is seen.

    Parameters
    ----------
    record : (n,), baseline already taken out
    natural_hz : (m,), Hz
    q : 1/(2ζ); ``inf`` for undamped oscillators

    Raises
    ------
    NotIdentified
        The sampling rate is below ten times the highest frequency: the maximum would be up to 8 % low.
    """
    highest = float(np.max(natural_hz))
    if rate_hz < FEWEST_PER_PERIOD * highest:
        raise NotIdentified(
            f"shock spectrum: {rate_hz:g} Hz for {highest:g} Hz, at least "
            f"{FEWEST_PER_PERIOD * highest:g} Hz is needed; lower the "
            "highest frequency, or sample faster"
        )
    tail = np.zeros(int(np.ceil(rate_hz / float(np.min(natural_hz)))) + 1)
    padded = np.concatenate([record, tail])
    return np.array([np.max(np.abs(responses(padded, rate_hz, float(f), q))) for f in natural_hz])
