"""Units told by their coefficients: whether a calibration fits the unit that its serial names, and whom it fits instead."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from inertial.arrays import Array, Flags, Index
from inertial.population.comparison import sigma_of

FEWEST = 10  # pairs of calibrations that a usual change is known from
FOREIGN_P = 1e-9  # probability of a distance at which a calibration counts as not of its unit
ALIKE_P = 1e-3  # … and above which another unit's earlier calibration fits it
TELLING = 5.0  # spread between units over change of one unit, below which a parameter does not distinguish units
_SHORTEST = 1.0 / 365.25  # years; what is closer is one occasion


@dataclass(frozen=True)
class ChangeScale:
    """How far parameters change from one calibration of a unit to another, and which of them tell units apart.

    years : (k,), rising times between two calibrations; change : (k, p), usual change after these
    telling : (p,)
    """

    years: Array
    change: Array
    telling: Flags

    @property
    def count(self) -> int:
        """Number of parameters that tell units apart."""
        return int(self.telling.sum())

    def after(self, years: Array | float) -> Array:
        """The usual change of the telling parameters after some years (...), (..., count); drift goes on beyond the longest."""
        t = np.asarray(years, dtype=float)
        change = self.change[:, self.telling]
        inside = np.clip(t, self.years[0], self.years[-1])
        usual = np.stack([np.interp(inside, self.years, of_parameter) for of_parameter in change.T], axis=-1)
        return usual * np.maximum(t / max(float(self.years[-1]), _SHORTEST), 1.0)[..., None]


def change_scale(
    values: Array, before: Array, years: Array | None = None, population: Array | None = None
) -> ChangeScale:
    """Robust spread of the change between calibrations of a unit, by the time between them, against the spread between units.

    Units that are measured every week would hide what a year does to the others: the times are parted in octaves, and a longer
    time never changes less.

    Parameters
    ----------
    values, before : (pairs, p), parameters of a calibration and of the one before it of the same serial
    years : (pairs,), between the two; all alike where None
    population : (units, p), one calibration of every unit; the values where None
    """
    time = np.zeros(len(values)) if years is None else years
    parts = _octaves(time)
    change = np.maximum.accumulate([sigma_of((values - before)[part]) for part in parts], axis=0)
    between = sigma_of(values if population is None else population)
    telling = np.all(change > 0.0, axis=0) & (between > TELLING * change[-1])
    knots = np.array([float(np.median(time[part])) for part in parts])
    return ChangeScale(knots, change, telling)


def _octaves(years: Array) -> list[Index]:
    """Places of the pairs in octaves of the time between, shortest first; too small ones go with the next longer."""
    octave = np.floor(np.log2(np.maximum(years, _SHORTEST)))
    parts: list[Index] = []
    waiting = np.zeros(0, dtype=np.int64)
    for number in np.unique(octave):
        waiting = np.concatenate([waiting, np.flatnonzero(octave == number)])
        if waiting.size >= FEWEST:
            parts.append(waiting)
            waiting = np.zeros(0, dtype=np.int64)
    if waiting.size and parts:
        parts[-1] = np.concatenate([parts[-1], waiting])
    return parts or [waiting]


def distance(values: Array, others: Array, scale: ChangeScale, years: Array | float = 0.0) -> Array:
    """Squared distance in units of the usual change after ``years``, summed over the telling parameters; over (..., p)."""
    z = (values - others)[..., scale.telling] / scale.after(years)
    return np.sum(z**2, axis=-1)


def foreign_above(scale: ChangeScale) -> float:
    """Squared distance beyond which a calibration is not of the unit it is said to be of."""
    return float(chi2.isf(FOREIGN_P, max(scale.count, 1)))


def alike_below(scale: ChangeScale) -> float:
    """Squared distance within which it may be of a unit."""
    return float(chi2.isf(ALIKE_P, max(scale.count, 1)))


def nearest(value: Array, others: Array, scale: ChangeScale, years: Array | float = 0.0) -> tuple[int, float]:
    """Which row of ``others`` (n, p) is most likely that of ``value`` (p,), ``years`` (n,) later, and its squared distance."""
    distances = distance(value, others, scale, years)
    # after a long time much is possible, and each of it is less likely
    best = int(np.argmin(distances + 2.0 * np.sum(np.log(scale.after(years)), axis=-1)))
    return best, float(distances[best])
