"""Dynamic tests: second-order transfer function, shock, centrifuge, settling."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import StateSpace, lsim

from inertial.errors import NotIdentified

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def transfer(frequency: ArrayLike, natural_hz: float, damping: float) -> Complex:
    """H(jω) = -1/((1 - (ω/ω_n)²) + 2jζω/ω_n) of a sprung mass, relative to its static answer's size.

    The sign is that of the displacement of the mass; an output that counts up with acceleration has -H.

    Parameters
    ----------
    frequency : (...), Hz
    natural_hz : Hz, undamped
    damping : ratio ζ
    """
    ratio = np.asarray(frequency, dtype=np.float64) / natural_hz
    return np.asarray(-1.0 / ((1.0 - ratio**2) + 2.0j * damping * ratio), dtype=np.complex128)


def bandwidth(natural_hz: float, damping: float) -> float:
    """Frequency in Hz where |H| is 3 dB (1/√2) below its static value.

    (1 - r²)² + 4ζ²r² = 2 solved for r = f/f_n.
    """
    q = 1.0 - 2.0 * damping**2
    return natural_hz * float(np.sqrt(q + np.sqrt(q**2 + 1.0)))


def damping_from_peak(frequency: ArrayLike, gain: ArrayLike) -> float:
    """Damping ratio from the width of the resonance at 1/√2 of its height, ζ ≈ (f₂ - f₁)/(2·f_peak); small ζ only.

    For ζ = 0.05 it is right to 1 %, for ζ = 0.2 it is 10 % off; above 0.38 there are no two such points: use
    `fit_second_order`.

    Parameters
    ----------
    frequency : (n,), Hz, increasing
    gain : (n,), |H|
    """
    f, size = np.asarray(frequency, dtype=np.float64), np.asarray(gain, dtype=np.float64)
    top = int(np.argmax(size))
    level = size[top] / np.sqrt(2.0)
    below, above = np.flatnonzero(size[:top] < level), np.flatnonzero(size[top:] < level)
    if below.size == 0 or above.size == 0:
        msg = "damping: the resonance never falls 3 dB on both sides of its peak; sweep wider, or fit the whole curve"
        raise NotIdentified(msg)
    left, right = int(below[-1]), top + int(above[0])
    f1 = np.interp(level, size[left : left + 2], f[left : left + 2])
    f2 = np.interp(-level, -size[right - 1 : right + 1], f[right - 1 : right + 1])
    return float((f2 - f1) / (2.0 * f[top]))


@dataclass(frozen=True)
class SecondOrder:
    """Answer of a sine sweep."""

    natural_hz: float
    damping: float
    sensitivity: float
    """Static gain, output unit per g."""

    @property
    def bandwidth_hz(self) -> float:
        """-3 dB bandwidth, Hz."""
        return bandwidth(self.natural_hz, self.damping)


def fit_second_order(frequency: ArrayLike, gain: ArrayLike) -> SecondOrder:
    """Natural frequency, damping and sensitivity from the gain of a sweep, by linear least squares.

    1/|H|² = s⁻²·(1 + (4ζ² - 2)·r² + r⁴) is linear in 1, f², f⁴; each point weighs as its gain is known to a share.

    Parameters
    ----------
    frequency : (n,), Hz
    gain : (n,), output unit per g
    """
    f, size = np.asarray(frequency, dtype=np.float64), np.asarray(gain, dtype=np.float64)
    if f.size < 4 or not np.all(size > 0.0):
        msg = f"sweep: {f.size} points, four or more with a positive gain are needed; sweep more frequencies"
        raise NotIdentified(msg)
    unit = f / f.max()
    rows = np.column_stack([np.ones_like(unit), unit**2, unit**4]) * (size**2)[:, None]
    c = np.asarray(np.linalg.lstsq(rows, np.ones_like(unit), rcond=None)[0], dtype=np.float64)
    if c[0] <= 0.0 or c[2] <= 0.0:
        msg = f"sweep: the gain up to {f.max():.4g} Hz does not bend as a second-order system's; sweep beyond the resonance"
        raise NotIdentified(msg)
    natural = (c[0] / c[2]) ** 0.25
    square = 0.25 * (c[1] * natural**2 / c[0] + 2.0)
    return SecondOrder(float(natural * f.max()), float(np.sqrt(max(square, 0.0))), float(1.0 / np.sqrt(c[0])))


@dataclass(frozen=True)
class Shock:
    """Answer to a half sine."""

    time: Array
    """(n,) s"""
    input: Array
    """(n,) g"""
    output: Array
    """(n,) g, as an output that counts up with acceleration"""
    overshoot: float
    """(largest output - amplitude)/amplitude."""
    undershoot: float
    """Largest negative output after the pulse, over the amplitude."""
    return_s: float
    """Time after the pulse until the output stays within the band."""


def half_sine(
    amplitude: float, duration_s: float, natural_hz: float, damping: float, *, band: float = 0.02, points: int = 4000
) -> Shock:
    """Answer of a second-order accelerometer to A0·sin(πt/T).

    Parameters
    ----------
    amplitude : A0, g
    duration_s : T, s; 1 to 10 ms in tests
    natural_hz, damping : of the accelerometer
    band : share of the amplitude within which the output has come back
    points : of the answer
    """
    rate, omega = damping * 2.0 * np.pi * natural_hz, 2.0 * np.pi * natural_hz
    end = duration_s + 12.0 / max(rate, 1e-12)
    time = np.linspace(0.0, min(end, duration_s + 400.0 / natural_hz), points)
    pulse = np.where(time <= duration_s, amplitude * np.sin(np.pi * time / duration_s), 0.0)
    system = StateSpace([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]], [[0.0], [omega**2]], [[1.0, 0.0]], [[0.0]])
    output = np.asarray(lsim(system, pulse, time)[1], dtype=np.float64)
    after = time > duration_s
    return Shock(
        time=time,
        input=pulse,
        output=output,
        overshoot=float(output.max() / amplitude - 1.0),
        undershoot=float(max(0.0, -output[after].min() / amplitude)),
        return_s=settling_time(time[after] - duration_s, output[after], final=0.0, band=band * amplitude),
    )


def settling_time(time: Array, response: Array, *, final: float, band: float) -> float:
    """Time in s from the first of `time` after which the response stays within ±`band` of `final`.

    Parameters
    ----------
    time : (n,), s
    response : (n,), any unit
    final, band : unit of the response

    Raises
    ------
    NotIdentified
        The response has not settled at the end of the record.
    """
    outside = np.flatnonzero(np.abs(response - final) > band)
    if outside.size == 0:
        return 0.0
    last = int(outside[-1])
    if last == len(time) - 1:
        off = abs(float(response[last]) - final)
        msg = f"settling: still {off:.3g} from the final value at {time[last]:.4g} s, within {band:.3g} is needed; record longer"
        raise NotIdentified(msg)
    return float(time[last + 1] - time[0])


@dataclass(frozen=True)
class Centrifuge:
    """Answer of a centrifuge test."""

    bias: float
    scale: float
    """Output unit per g."""
    bias_error: float
    scale_error: float
    linearity_percent: float
    """Largest |V - V_fit| over the full-scale output span, %."""
    residuals: Array
    """(n,), output unit."""


def centrifuge(
    rate_rad_s: ArrayLike, output: ArrayLike, radius_m: float, *, full_scale_g: float, standard_gravity: float = 9.80665
) -> Centrifuge:
    """Bias, scale and linearity error from a = r·ω².

    Parameters
    ----------
    rate_rad_s : (n,), rad/s
    output : (n,), output unit
    radius_m : to the seismic mass, m; its error is the scale's, in full
    full_scale_g : range, g, to which the linearity error is referred
    standard_gravity : m/s² in one g
    """
    force = radius_m * np.asarray(rate_rad_s, dtype=np.float64) ** 2 / standard_gravity
    v = np.asarray(output, dtype=np.float64)
    if force.size < 3 or float(np.ptp(force)) <= 0.0:
        msg = f"centrifuge: {force.size} speeds over {np.ptp(force):.3g} g, three different ones are needed; add speeds"
        raise NotIdentified(msg)
    rows = np.column_stack([np.ones_like(force), force])
    c = np.asarray(np.linalg.lstsq(rows, v, rcond=None)[0], dtype=np.float64)
    residuals = v - rows @ c
    spread = np.linalg.inv(rows.T @ rows) * (residuals @ residuals) / (force.size - 2)
    return Centrifuge(
        bias=float(c[0]),
        scale=float(c[1]),
        bias_error=float(np.sqrt(spread[0, 0])),
        scale_error=float(np.sqrt(spread[1, 1])),
        linearity_percent=float(100.0 * np.max(np.abs(residuals)) / (abs(c[1]) * full_scale_g)),
        residuals=residuals,
    )
