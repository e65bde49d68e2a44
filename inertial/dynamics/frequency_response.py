"""Frequency response from one recording of any broadband motion: random vibration, a swept sine, an impact.

The spectra of the whole record are averaged over bands of neighbouring lines. For stationary vibration that is worth as much as
averages over segments (J. S. Bendat, A. G. Piersol, Random Data, 4th ed., sections 8.5.4 and 9.2), and it holds for a sweep as
well, of which every segment has another part.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import czt
from scipy.signal.windows import tukey
from scipy.stats import norm, t

from inertial.arrays import Array, Complex, Flags
from inertial.errors import NotIdentified

PER_OCTAVE = 24
FEWEST_LINES = 6
"""Of a band: two complex coefficients are fitted to them."""
_TAPER = 0.1
"""Share of the record in which the window rises and falls."""
_INDEPENDENT = (1.0 - 5.0 * _TAPER / 8.0) ** 2 / (1.0 - 93.0 * _TAPER / 128.0)
"""Independent lines per line behind this window: (Σw²)²/(n·Σw⁴)."""
EXCITED = 1e-4
"""Density of the reference over its largest below which a band holds what the window leaks, not the motion."""
LARGEST_ERROR = 0.1
"""Relative standard uncertainty of the magnitude above which a band counts as not excited."""


@dataclass(frozen=True)
class Response:
    """A frequency response in bands, (m,) each.

    frequency : Hz, mean of the band's lines weighted by the power of the reference
    h1, h2 : output over reference, from the cross spectrum over the spectrum of the reference, and the output's over the cross
        spectrum: noise of the output leaves the first right, noise of the reference the second
    coherence : γ², ordinary
    error : standard uncertainty of the magnitude of ``h1`` as a share of it, and of its phase in rad, by noise of the output
    lines : independent lines of the band
    """

    frequency: Array
    h1: Complex
    h2: Complex
    coherence: Array
    error: Array
    lines: Array

    def picked(self, rows: Flags) -> "Response":
        """Some of the bands."""
        return Response(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def frequency_response(
    reference: tuple[Array, float], output: tuple[Array, float], *, per_octave: int = PER_OCTAVE, late_s: float = 0.0
) -> Response:
    """H1, H2 and coherence of an output over a reference, in bands that the motion excites.

    Within a band the response may have a slope; its curvature, which an average over the band lowers a peak by, is taken from
    the bands beside it.

    Parameters
    ----------
    reference, output : samples (n,) in any unit and their rate, Hz, of the same motion; the rates may differ
    per_octave : bands in an octave, of six lines at least
    late_s : begin of the output after that of the reference, s

    Raises
    ------
    NotIdentified
        The record is too short, or no band of the reference stands out of the noise.
    """
    (x, x_rate), (y, y_rate) = reference, output
    seconds = min(x.size / x_rate, y.size / y_rate)
    top = 0.45 * min(x_rate, y_rate)
    lines = np.arange(1, int(top * seconds))
    if lines.size < 8 * FEWEST_LINES:
        needed = 8 * FEWEST_LINES
        raise NotIdentified(
            f"response: {seconds:.3g} s give {lines.size} lines up to {top:.4g} Hz, {needed} are needed; record longer"
        )
    f = lines / seconds
    from_x, from_y = (_lines(wave, rate, seconds, lines.size) for wave, rate in ((x, x_rate), (y, y_rate)))
    from_y = from_y * np.exp(-2j * np.pi * f * late_s)
    delay = _delay(from_x, from_y, seconds)
    turned = from_y * np.exp(2j * np.pi * f * delay)
    rows = [_band(f[a:b], from_x[a:b], turned[a:b]) for a, b in _edges(f, per_octave)]
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    made = Response(*columns)
    # a few lines know their own noise badly: widened so that k = 2 covers 95.45 % (JCGM 100, G.3)
    widened = t.isf(norm.sf(2.0), np.maximum(2.0 * made.lines - 4.0, 1.0)) / 2.0
    made = _sharpened(replace(made, error=made.error * widened))
    power = np.array([np.mean(np.abs(from_x[a:b]) ** 2) for a, b in _edges(f, per_octave)])
    usable = (made.error < LARGEST_ERROR) & (power > EXCITED * power.max())
    if not usable.any():
        raise NotIdentified(
            "response: in no band does the output follow the reference; check channels, cable and mounting"
        )
    made = made.picked(usable)
    back = np.exp(-2j * np.pi * made.frequency * delay)
    return replace(made, h1=made.h1 * back, h2=made.h2 * back)


def _lines(wave: Array, rate_hz: float, seconds: float, count: int) -> Complex:
    """Spectrum of the first ``seconds`` at k/seconds, k = 1 … ``count``, behind the window, of any rate."""
    n = round(seconds * rate_hz)
    part = (wave[:n] - wave[:n].mean()) * tukey(n, _TAPER, sym=False)
    step = -2j * np.pi / (seconds * rate_hz)
    return np.asarray(czt(part, count, np.exp(step), np.exp(-step)) / rate_hz, dtype=np.complex128)


def _delay(x: Complex, y: Complex, seconds: float) -> float:
    """The delay of the output, s, by the largest correlation: a phase that turns within a band would lower its average."""
    cross = np.fft.irfft(np.concatenate([[0.0], np.conj(x) * y]))
    lag = int(np.argmax(np.abs(cross)))
    lag -= cross.size if lag > cross.size // 2 else 0
    return lag * seconds / cross.size


def _edges(f: Array, per_octave: int) -> list[tuple[int, int]]:
    """First line and the one after the last of every band, each ``1/per_octave`` of an octave wide, or of the fewest lines."""
    edges, first = [], 0
    while f.size - first >= FEWEST_LINES:
        stop = int(np.searchsorted(f, f[first] * 2.0 ** (1.0 / per_octave)))
        stop = max(stop, first + FEWEST_LINES)
        if stop > f.size:
            break
        edges.append((first, stop))
        first = stop
    return edges


def _band(f: Array, x: Complex, y: Complex) -> tuple[float, complex, complex, float, float, float]:
    """One band: frequency, H1, H2, coherence, relative uncertainty, independent lines.

    With a line a + b·(f − f₀) fitted by least squares weighted with the power of the reference, a is H1 at the mean f₀.
    """
    power = np.abs(x) ** 2
    total = float(power.sum())
    if not total > 0.0:
        return float(f.mean()), 0j, 0j, 0.0, np.inf, float(f.size)
    middle = float(power @ f) / total
    cross, across = complex(np.vdot(x, y)), float(np.sum(np.abs(y) ** 2))
    h1 = cross / total
    apart = f - middle
    slope = complex(np.sum(np.conj(x) * y * apart)) / float(power @ apart**2)
    left = float(np.sum(np.abs(y - (h1 + slope * apart) * x) ** 2))
    lines = _INDEPENDENT * f.size
    noise = left / max(lines - 2.0, 1.0) * lines / f.size
    size = abs(h1)
    error = float(np.sqrt(0.5 * noise / total / _INDEPENDENT) / size) if size > 0.0 else np.inf
    coherence = abs(cross) ** 2 / (total * across) if across > 0.0 else 0.0
    return middle, h1, across / np.conj(cross) if cross else 0j, coherence, error, lines


def _sharpened(response: Response) -> Response:
    """The response with the average over each band undone to the second order: H − Δ²H/24 for bands of equal width.

    A third of what is added stays as a rectangular uncertainty: neighbours that are not excited show no curvature.
    """
    h = response.h1
    if h.size < 3:
        return response
    bend = np.zeros_like(h)
    bend[1:-1] = (h[2:] - 2.0 * h[1:-1] + h[:-2]) / 24.0
    sound = response.error < LARGEST_ERROR
    bend[1:-1][~(sound[2:] & sound[1:-1] & sound[:-2])] = 0.0
    error = np.hypot(response.error, np.abs(bend) / np.maximum(np.abs(h), 1e-300) / 3.0)
    return replace(response, h1=h - bend, h2=response.h2 - bend, error=error)


_PARTS = 8
_SHORTEST_PART_S = 0.25
_LARGEST_DEPARTURE = 0.01
"""The share of a part that its window leaves at the end: a clock that departs by more runs out of the record."""


def clock_departure(reference: tuple[Array, float], output: tuple[Array, float]) -> tuple[float, float]:
    """Departure of the output's clock from the reference's as a share, and its standard uncertainty.

    The delay in each part of the record follows from the slope of the phase over frequency, weighted with the power that both
    channels have in common; over the record it grows with the departure. A share of 1e-5 over ten seconds turns the phase at
    2 kHz by more than half a turn, so that the response of the whole record needs it.

    Parameters
    ----------
    reference, output : samples (n,) and nominal rate, Hz; both begin at one instant

    Raises
    ------
    NotIdentified
        The delays follow no clock near the nominal one, as where the output does not follow the reference.
    """
    (x, x_rate), (y, y_rate) = reference, output
    seconds = min(x.size / x_rate, y.size / y_rate)
    count = min(_PARTS, int(seconds / _SHORTEST_PART_S))
    if count < 3:
        return 0.0, 0.0
    departure, error = 0.0, 0.0
    for _ in range(3):
        rate = y_rate / (1.0 + departure)
        delays = np.array([_delay_of_part(k, seconds / count, (x, x_rate), (y, rate)) for k in range(count)])
        middle = (np.arange(count) + 0.5) * seconds / count
        apart = middle - middle.mean()
        slope = float(apart @ delays / (apart @ apart))
        left = delays - delays.mean() - slope * apart
        departure, error = departure - slope, float(np.sqrt(left @ left / (count - 2) / (apart @ apart)))
        if not abs(departure) < _LARGEST_DEPARTURE:
            raise NotIdentified(
                "response: the output has no common clock with the reference; check channels, cable and mounting"
            )
    return departure, error


def _delay_of_part(number: int, lasting: float, reference: tuple[Array, float], output: tuple[Array, float]) -> float:
    """The delay of the output in one part of a record, s."""
    spectra: list[Complex] = []
    begins: list[float] = []
    size = int(0.45 * min(reference[1], output[1]) * 0.99 * lasting)
    for wave, rate in (reference, output):
        first = round(number * lasting * rate)
        begins.append(first / rate)
        spectra.append(_lines(wave[first:], rate, 0.99 * lasting, size))
    f = np.arange(1, size + 1) / (0.99 * lasting)
    y = spectra[1] * np.exp(-2j * np.pi * f * (begins[1] - begins[0]))
    coarse = _delay(spectra[0], y, 0.99 * lasting)
    cross = np.conj(spectra[0]) * y * np.exp(2j * np.pi * f * coarse)
    # lines of a band together: the phase of a single one is mostly noise
    bands = cross[: size // FEWEST_LINES * FEWEST_LINES].reshape(-1, FEWEST_LINES).sum(axis=1)
    middle = f[: size // FEWEST_LINES * FEWEST_LINES].reshape(-1, FEWEST_LINES).mean(axis=1)
    weight = np.abs(bands)
    return coarse - float(np.sum(weight * middle * np.angle(bands))) / float(2.0 * np.pi * np.sum(weight * middle**2))
