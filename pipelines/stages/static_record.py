"""The static record of a lot, collected table by table: samples, resolution of the digits, known temperature response."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
import pandas as pd

from inertial import design
from inertial.arrays import Array
from inertial.fits.linear import force_along_axes
from inertial.frames import force_from_angles
from inertial.noise.resolution import FINE, most, ripple, step_of, without_rounding
from inertial.noise.terms import NoiseTerms
from inertial.state import State
from pipelines.tables.calibration import Calibration
from schemas.units import AXES

COUNTED = 1000
"""Largest number of distinct values of a channel that are counted: an output with more values has no coarse digits."""
SMOOTHED_S = 120.0
"""Averaging time of the temperature readings, so that the noise of the thermometer does not enter the corrected output."""
FEWEST_READINGS = 5


@dataclass
class Digits:
    """Counts of the distinct values of a channel, and its sample variance from differences of neighbours."""

    counts: dict[float, int] = field(default_factory=dict)
    many: bool = False
    n: int = 0
    squares: float = 0.0
    last: float = float("nan")

    def add(self, values: Array) -> None:
        """Adds samples (n,) that follow the earlier ones."""
        if not values.size:
            return
        steps = np.diff(np.concatenate([[self.last], values]) if self.n else values)
        self.squares += float(np.sum(steps**2))
        self.n, self.last = self.n + values.size, float(values[-1])
        if self.many:
            return
        for value, count in zip(*np.unique(values, return_counts=True), strict=True):
            self.counts[float(value)] = self.counts.get(float(value), 0) + int(count)
        self.many = len(self.counts) > COUNTED

    @property
    def step(self) -> float:
        """Step between two digits, unit of the output; zero if none is detected."""
        return 0.0 if self.many else step_of(np.array(list(self.counts)))

    @property
    def variance(self) -> float:
        """Variance of a sample from differences of neighbours, unit of the output squared."""
        return 0.5 * self.squares / max(self.n - 1, 1)

    @property
    def outside(self) -> float:
        """Share of the samples that differ from the most frequent value."""
        return 1.0 - max(self.counts.values(), default=0) / max(self.n, 1)


class StaticSeries:
    """Outputs of the static record, collected table by table as means of ``size`` samples.

    From an averaging time of ``size`` samples on, the Allan deviation of the means equals that of the samples.
    """

    def __init__(self, units: Sequence[str], size: int, letters: Sequence[str] = AXES) -> None:
        self.size, self._letters = max(size, 1), list(letters)
        self._rest: dict[str, Array] = {unit: np.zeros((0, len(letters))) for unit in units}
        self._means: dict[str, list[Array]] = {unit: [] for unit in units}
        self.digits = {unit: tuple(Digits() for _ in letters) for unit in units}

    def add(self, samples: pd.DataFrame) -> None:
        """Adds the samples that follow the earlier ones."""
        output = samples[self._letters].to_numpy(dtype=float)
        for unit, rows in samples.groupby("unit", sort=False).indices.items():
            if unit in self._rest:
                joined = np.concatenate((self._rest[str(unit)], output[rows]))
                end = len(joined) // self.size * self.size
                self._means[str(unit)].append(joined[:end].reshape(-1, self.size, len(self._letters)).mean(axis=1))
                self._rest[str(unit)] = joined[end:]
                for axis, digits in enumerate(self.digits[str(unit)]):
                    digits.add(output[rows, axis])

    def of(self, unit: str) -> Array:
        """Outputs (n, m) of a unit; none where it was not recorded."""
        return np.concatenate(self._means[unit] or [np.zeros((0, len(self._letters)))])


@dataclass(frozen=True)
class Warmed:
    """The response of an output to the temperature of the static record, by the tempco of the model.

    change : (n, m), output unit, change of the output about its mean; zero if unknown
    span_K : range of the smoothed temperature, NaN if it was not read often enough
    known : whether the model has a temperature coefficient
    """

    change: Array
    span_K: float
    known: bool


def warmed(
    calibration: Calibration, unit: str, time: Array, reading: pd.Series, history: pd.DataFrame | None
) -> Warmed:
    """The known response of a record to its temperature.

    The temperature readings of the table ``history`` are averaged over two minutes; the model's temperature effects are evaluated
    at these in the pose of the record, and interpolated.

    Parameters
    ----------
    time : (n,), s, of the values
    reading : row of the static record in the table of readings, with the table angles
    """
    still = np.zeros((time.size, len(calibration.axes)))
    smoothed = None if history is None or not time.size else _smoothed(history, unit, float(time[0]), float(time[-1]))
    effects = [e for e in design.split(calibration.effects)[0] if "temperature" in e.id]
    if smoothed is None:
        return Warmed(still, float("nan"), bool(effects))
    when, temperature = smoothed
    span = float(np.ptp(temperature))
    if not effects:
        return Warmed(still, span, known=False)
    outer, inner = (np.radians(float(reading[name])) for name in ("outer_deg", "inner_deg"))
    force = np.broadcast_to(force_from_angles(outer, inner), (when.size, 3))
    if not np.all(np.isfinite(force)):
        return Warmed(still, span, known=False)
    index = calibration.units.index(unit)
    felt = force_along_axes(calibration.response[index], force)
    state = State(force=force, time=when, temperature=temperature, felt=felt, axes=calibration.axes)
    columns = design.local_columns(effects, state, {})
    coefficients = np.concatenate([calibration.value(e.id)[index] for e in effects], axis=-1)
    change = np.einsum("anp,ap->na", columns, coefficients)
    along = np.stack([np.interp(time, when, part) for part in change.T], axis=1)
    return Warmed(along - along.mean(axis=0), span, known=True)


def _smoothed(history: pd.DataFrame, unit: str, start: float, stop: float) -> tuple[Array, Array] | None:
    """Times (m,) and averaged temperatures (m,) of a unit during its record; None if it was read too rarely."""
    rows = history[(history["unit"] == unit) & history["time_s"].between(start - SMOOTHED_S, stop + SMOOTHED_S)]
    rows = rows[np.isfinite(rows["unit_C"].to_numpy(dtype=float))].sort_values("time_s")
    time, value = rows["time_s"].to_numpy(dtype=float), rows["unit_C"].to_numpy(dtype=float)
    during = np.count_nonzero((time >= start) & (time <= stop))
    if during < FEWEST_READINGS or not np.ptp(time) > 0.0:
        return None
    sums = np.concatenate([[0.0], np.cumsum(value)])
    first = np.searchsorted(time, time - 0.5 * SMOOTHED_S, side="left")
    last = np.searchsorted(time, time + 0.5 * SMOOTHED_S, side="right")
    return time, (sums[last] - sums[first]) / (last - first)


SHOWN = 0.02
"""Smallest share of rounding in the variance that is stated and subtracted."""


@dataclass(frozen=True)
class Coarse:
    """Resolution of one channel.

    step : µg, between two digits, zero if none is detected; variance : µg², of rounded samples, from differences of neighbours
    most : µg, upper limit (95 %) of the standard deviation of a sample before rounding
    """

    step: float
    variance: float
    most: float

    @classmethod
    def of(cls, digits: Digits, scale: float) -> Self:
        """Digits of a channel whose output is ``scale`` times µg."""
        step = digits.step / abs(scale)
        largest = most(step, digits.outside, digits.n) if step > 0.0 else np.inf
        return cls(step, digits.variance / scale**2, largest)

    @property
    def matters(self) -> bool:
        """Whether the share of rounding in the noise is large enough to state."""
        return self.step > 0.0 and self.step**2 / 12.0 > SHOWN * self.variance

    @property
    def spread(self) -> float:
        """Standard deviation, µg, of a sample before rounding, by Sheppard's correction."""
        return float(np.sqrt(without_rounding(np.asarray(self.variance), np.asarray(self.step))))

    @property
    def correctable(self) -> bool:
        """Whether rounding adds the variance q²/12 and almost no other error."""
        return self.spread >= FINE * self.step


def remark(digits: Coarse, unit: str = "µg") -> str:
    """The remark about N if the digits, in ``unit``, are coarse; else empty."""
    if not digits.matters:
        return ""
    step = f"the last digit is {digits.step:.3g} {unit}"
    if digits.correctable:
        return (
            f"{step}, {digits.step / digits.spread:.2g} of a sample's noise: its q²/12 is subtracted from N (Sheppard)"
        )
    return f"{step}, more than twice a sample's noise: N has only an upper limit; use a finer resolution"


def without_digits(terms: NoiseTerms, digits: Sequence[Coarse], rate_hz: float) -> NoiseTerms:
    """The terms (channels, 5) without the contribution of coarse digits to N.

    With noise above half a digit, rounding adds a white variance of q²/12 per sample; the intervals are widened for the unknown
    position of the mean between two digits. With less noise the output only shows how often the noise reaches the next digit: N
    then has an upper limit only.

    Parameters
    ----------
    rate_hz : of the samples that were rounded
    """
    n = terms.symbols.index("N")
    value, low, high = (part.copy() for part in (terms.value, terms.low, terms.high))
    for c, digit in enumerate(digits):
        if not digit.matters:
            continue
        if digit.correctable:
            rounding, left = digit.step**2 / 12.0, float(ripple(np.asarray(digit.spread), np.asarray(digit.step)))
            value[c, n] = _less(value[c, n], rounding, rate_hz)
            low[c, n] = _less(low[c, n], rounding + left, rate_hz)
            high[c, n] = _less(high[c, n], rounding - left, rate_hz)
        else:
            value[c, n], low[c, n] = np.nan, 0.0
            high[c, n] = max(high[c, n], digit.most / np.sqrt(rate_hz))
    return replace(terms, value=value, low=low, high=high)


def _less(coefficient: float, variance: float, rate_hz: float) -> float:
    """N after subtraction of a white variance per sample."""
    return float(np.sqrt(max(coefficient**2 - variance / rate_hz, 0.0)))
