"""Running sums over the lots so far: the evidence of a driver, the sizes of its levels, the scale of the increments."""

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from inertial.arrays import Array, Places, over

FIRST = 30
"""Number of lots held back until their medians limit the influence of each: a lot multiplies evidence by 1.65 at most."""

BOUND = 5.0
"""Limit, in standard deviations, to which the value of a lot is clipped."""

_MIXED = np.array([0.3, 0.03, 0.003])
_RATES: Array = np.exp2(np.arange(1.0, -15.0, -1.0))


@dataclass
class Sums:
    """Sums Σx, Σx² of one driver for every hypothesis, then for every effect with all its columns.

    effects : (h,), index of the effect of each hypothesis; None without sums for complete effects
    """

    s: Array
    v: Array
    two_sided: bool
    effects: Places | None = None

    @classmethod
    def of(cls, count: int, *, two_sided: bool, effects: Places | None = None) -> "Sums":
        """Sums before the first lot, for ``count`` hypotheses."""
        size = count + (0 if effects is None else int(effects.max(initial=-1)) + 1)
        return cls(np.zeros(size), np.zeros(size), two_sided, effects)

    def add(self, x: Array) -> None:
        """Add the increments (h,) of a lot."""
        if self.effects is not None:
            # increments of either sign are multiplied by the prediction of earlier lots
            signed = x * self.s[: x.size] / (self.v[: x.size] + FIRST) if self.two_sided else x
            wholes = np.bincount(self.effects, signed, self.s.size - x.size)
            x = np.concatenate([x, np.asarray(wholes, dtype=np.float64)])
        self.s += x
        self.v += x**2

    @property
    def log_e(self) -> Array:
        """Logarithm of the evidence, (h + effects,)."""
        rates = _RATES[:, None]
        out = logsumexp(rates * self.s - 0.5 * rates**2 * self.v, axis=0) - np.log(_RATES.size)
        if self.two_sided:
            single = slice(None) if self.effects is None else slice(self.effects.size)
            s, grown = self.s[single], 1.0 + _MIXED[:, None] * self.v[single]
            each = -0.5 * np.log(grown) + 0.5 * _MIXED[:, None] * s**2 / grown
            out[single] = logsumexp(each, axis=0) - np.log(_MIXED.size)
        return out


def growth_of(contributions: Array) -> Array:
    """Logarithm of the one-sided evidence of contributions (n,) after each of them, in units of their root mean square."""
    x = contributions / (float(np.sqrt(np.mean(contributions**2))) or 1.0)
    return Sums(np.cumsum(x), np.cumsum(x**2), two_sided=False).log_e


class Levels:
    """Sums over earlier lots of the scores and of the information of every level of a driver, (levels, h) each."""

    def __init__(self, count: int) -> None:
        self.place: dict[str, int] = {}
        self._sums = np.zeros((2, 0, count))

    @property
    def score(self) -> Array:
        """Scores (levels, h)."""
        return self._sums[0, : len(self.place)]

    @property
    def information(self) -> Array:
        """Information (levels, h)."""
        return self._sums[1, : len(self.place)]

    def of(self, label: str) -> Array:
        """Score and information of a level, (2, h); zero if unknown."""
        return self._sums[:, self.place[label]] if label in self.place else np.zeros((2, self._sums.shape[2]))

    def predicted(self, labels: tuple[str, ...], prior: Array, without: "Levels | None" = None) -> tuple[Array, Array]:
        """Predicted sizes (units, h), shrunk towards zero by a prior information (h,), and their information (units, h).

        Parameters
        ----------
        without : sums of lots that are excluded from the prediction
        """
        sizes, behind = np.zeros((2, len(labels), prior.size))
        for unit, label in enumerate(labels):
            if label in self.place:
                sums = self.of(label) - (0.0 if without is None else without.of(label))
                sizes[unit], behind[unit] = over(sums[0], sums[1] + prior), sums[1]
        return sizes, behind

    def add(self, labels: tuple[str, ...], score: Array, information: Array) -> None:
        """Add scores and information (units, h)."""
        for unit, label in enumerate(labels):
            if not label:
                continue
            at = self.place.setdefault(label, len(self.place))
            if at >= self._sums.shape[1]:
                more = np.zeros((2, max(16, at), self._sums.shape[2]))
                self._sums = np.concatenate([self._sums, more], axis=1)
            self._sums[:, at] += score[unit], information[unit]


class Scale:
    """Root mean square of the earlier values, each clipped; it starts from a median of the first lots."""

    def __init__(self, start: Array) -> None:
        self.sums = np.stack([10.0 * start**2, np.full(start.size, 10.0)])  # Σx², n

    @property
    def rms(self) -> Array:
        """Root mean square (h,) of the values so far."""
        return np.sqrt(self.sums[0] / self.sums[1])

    def bounded(self, value: Array) -> Array:
        """A value (h,) clipped to five standard deviations."""
        limit = BOUND * self.rms
        return np.clip(value, -limit, limit)

    def standardised(self, value: Array) -> Array:
        """A value (h,), clipped, over the root mean square of the earlier ones, which it joins."""
        bounded, rms = self.bounded(value), self.rms
        self.add(bounded)
        return bounded / rms

    def add(self, value: Array) -> None:
        """Add a clipped value (h,); zeros are not counted."""
        self.sums += value**2, value != 0.0
