"""The measured dwells of a lot, the input of the search for data faults."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inertial.arrays import Array, Flags, Places
from inertial.frames import shown_force
from inertial.state import ALL_AXES

STANDARD_GRAVITY = 9.80665  # m/s² in one g
_TURNED = 0.05  # singular value of the design over √dwells, below which poses do not separate response and bias
_WARM = 2.5
"""Largest deviation of the temperature from its mean, K, up to which no slope of the bias is subtracted from the output."""

FAR_G = 0.02
"""Misfit, g, above which a dwell may be in another pose: more than a device's gain changes between two soaks."""

FOLLOWS_G = 0.3
"""Median misfit, g, from which an output does not follow the poses: other rows leave 0.4 to 1, noise more, angles 5° off 0.05."""

_ROUNDS = 12  # of reweighting
_TUKEY = 4.685
"""Widths of the biweight: 95 % efficiency under normal noise (Holland & Welsch, Commun. Stat. A6 (1977) 813)."""


@dataclass(frozen=True)
class Readings:
    """Readings of a lot, dwells in the order of their numbers; NaN where a unit lacks a dwell.

    force : (units, n, 3), g, commanded
    output, spread : (units, n, 3), output unit; mean, and standard deviation of the samples (None if not recorded)
    slow : (units, n, 3), output unit; equivalent white deviation of :data:`inertial.quantities.SLOW_COLUMNS`; or None
    count : (units, n), samples averaged; duration : (units, n), s; each None if not recorded
    time : (units, n), s
    temperature, chamber, vibration : (units, n), °C, °C, g; None if not recorded
    unit_name : the output's unit if stated ("g", "V", "LSB")
    axes : sensor axes with an output
    history_end : s, last time of the temperature history, if there is one
    """

    force: Array
    output: Array
    time: Array
    spread: Array | None = None
    slow: Array | None = None
    count: Array | None = None
    duration: Array | None = None
    temperature: Array | None = None
    chamber: Array | None = None
    vibration: Array | None = None
    unit_name: str | None = None
    history_end: float | None = None
    axes: tuple[int, ...] = ALL_AXES

    @cached_property
    def there(self) -> Flags:
        """Whether each unit has each dwell, (units, n)."""
        there: Flags = np.all(np.isfinite(self.output), axis=-1)
        return there

    @property
    def mean_error(self) -> Array | None:
        """Standard errors of the dwell means from their samples, (units, n, 3), output unit; None if not recorded."""
        deviation = self.spread if self.slow is None else self.slow
        if deviation is None or self.count is None:
            return None
        return deviation / np.sqrt(np.maximum(self.count, 1.0))[..., None]

    @property
    def warm(self) -> Array | None:
        """Temperature of the units, else of the chamber, (units, n), °C; None if neither was recorded."""
        return self.temperature if self.temperature is not None else self.chamber

    @cached_property
    def turned(self) -> bool:
        """Whether the poses separate response and bias; otherwise faults of the response cannot be detected."""
        x = design(self.force[0][:, self.axes])
        return bool(np.linalg.svd(x, compute_uv=False)[-1] > _TURNED * np.sqrt(len(x)))

    @cached_property
    def fits(self) -> Array:
        """Robust bias and response of every unit, (units, m, 4): columns 1, fx, fy, fz; output unit.

        If the poses do not turn, the response is the nominal one of the output's unit.
        """
        if not self.turned:
            return np.stack([self._nominal(f, o) for f, o in zip(self.force, self.output, strict=True)])
        return robust_fits(shown_force(self.force, self.axes), self.output)

    def _nominal(self, force: Array, output: Array) -> Array:
        """Bias and nominal response, (m, 4): 1 for g, 9.80665 for m/s², else the median norm of output over that of force.

        The norms are those of single dwells, because the mean output of a tumble about one axis is its bias.
        """
        known = {"g": 1.0, "m/s^2": STANDARD_GRAVITY}
        felt = force[:, self.axes]
        typical, turned = (float(np.nanmedian(np.linalg.norm(values, axis=-1))) for values in (output, felt))
        scale = known.get(self.unit_name or "", typical / turned if min(typical, turned) > 0.0 else 1.0)
        bias = np.nanmedian(output - scale * felt, axis=0)
        return np.concatenate([bias[:, None], scale * np.eye(3)[list(self.axes)]], axis=1)

    @cached_property
    def scale(self) -> Array:
        """Typical output per g of every unit, (units,): the root of the mean squared response."""
        return np.sqrt(np.sum(self.fits[:, :, 1:] ** 2, axis=(1, 2)) / len(self.axes))

    @cached_property
    def follows(self) -> Flags:
        """Whether the output of each unit follows its poses, (units,); else its response says nothing about the unit."""
        follows: Flags = np.nanmedian(np.linalg.norm(self.misfit, axis=-1), axis=1) < FOLLOWS_G
        return follows

    @cached_property
    def without_bias_slope(self) -> "Readings":
        """The readings less a linear temperature dependence of the bias; their :attr:`fits` are computed anew.

        The slope is fitted robustly with a constant response. Without it, a sensor of 1 mg/K would seem to be in other poses in a
        cold soak; with slopes of the response as well, the fit of a short plan could absorb a wrong pose.
        """
        warm = self.warm
        if warm is None or not self.turned or not np.isfinite(warm[self.there]).all():
            return self
        theta = warm - np.nanmean(warm, axis=1, keepdims=True)
        if np.nanmax(np.abs(theta)) < _WARM:
            return self
        # the temperature beside the three forces: one more column of the design
        driven = np.concatenate([shown_force(self.force, self.axes), theta[..., None]], axis=-1)
        slope = robust_fits(driven, self.output, least=FAR_G * self.scale)[..., 4]
        return replace(self, output=self.output - theta[..., None] * slope[:, None, :])

    @cached_property
    def misfit_when_warm(self) -> Array:
        """Residuals of a robust fit with temperature slopes, (units, n, 3), g; :attr:`misfit` where no temperature is recorded.

        Without slopes, dwells of a cold soak of a sensor with 1 mg/K would be far from the others.
        """
        warm = self.warm
        if warm is None or not self.turned or not np.isfinite(warm[self.there]).all():
            return self.misfit
        force, theta = shown_force(self.force, self.axes), warm - np.nanmean(warm, axis=1, keepdims=True)
        left = self.output - design(force, theta) @ np.swapaxes(robust_fits(force, self.output, theta), -1, -2)
        return left / np.where(self.scale > 0.0, self.scale, 1.0)[:, None, None]

    @cached_property
    def misfit(self) -> Array:
        """Residuals of the robust fit over the unit's scale, (units, n, 3), g."""
        model = np.einsum("unp,uip->uni", design(self.force), self.fits)
        return (self.output - model) / np.where(self.scale > 0.0, self.scale, 1.0)[:, None, None]


def design(force: Array, theta: Array | None = None) -> Array:
    """Columns (..., 4) of bias and response for a force (..., 3), g; with a temperature (...,), K, and their slopes, (..., 8)."""
    x = np.concatenate([np.ones((*force.shape[:-1], 1)), force], axis=-1)
    return x if theta is None else np.concatenate([x, theta[..., None] * x], axis=-1)


def robust_fits(force: Array, output: Array, theta: Array | None = None, *, least: Array | float = 0.0) -> Array:
    """Robust bias and response of units (units, 3, 4), output unit, by least squares reweighted with Tukey's biweight.

    Dwells are weighted by the norm of their residual over the three axes, so that a wrong pose loses weight on all three.

    Parameters
    ----------
    force, output : (units, n, 3), g and output unit
    theta : (units, n), temperature above the reference, K; then the temperature slopes are fitted too and appended, (units, 3, 8)
    least : (units,) or one, residual norm, output unit, up to which a dwell has full weight: where many dwells agree closely,
        dwells at another temperature would otherwise have no weight
    """
    there: Flags = np.all(np.isfinite(output), axis=-1)
    x, y = (np.where(there[..., None], values, 0.0) for values in (design(force, theta), output))
    weight, floor = there.astype(float), np.broadcast_to(least, len(y))
    coefficients = np.zeros((len(y), x.shape[-1], y.shape[-1]))
    halves = (there.sum(axis=-1, keepdims=True) + np.array([-1, 0])) // 2  # places of the median among what is there
    left = np.arange(len(y))  # units that are not done
    for turn in range(_ROUNDS):
        q, r = np.linalg.qr(x[left] * weight[left, :, None])
        coefficients[left] = np.linalg.pinv(r, rcond=1e-9) @ (np.swapaxes(q, -1, -2) @ (y * weight[..., None])[left])
        size = np.linalg.norm(y[left] - x[left] @ coefficients[left], axis=-1)
        ordered = np.sort(np.where(there[left], size, np.inf), axis=-1)
        middle = 0.5 * (np.take_along_axis(ordered, halves[left], axis=-1).sum(axis=-1, keepdims=True))
        going = middle[:, 0] > 0.0
        left, size, middle = left[going], size[going], middle[going]
        # least absolute deviations first: started from least squares, the biweight could converge between outliers
        u = size / (_TUKEY * np.maximum(1.5 * middle, floor[left, None]))
        weighted = (
            np.sqrt(1.0 / np.maximum(size, np.maximum(0.1 * middle, floor[left, None])))
            if turn < 5
            else np.where(u < 1.0, 1.0 - u**2, 0.0)
        )
        weight[left] = weighted * there[left]
        left = left[np.count_nonzero(weight[left], axis=-1) > x.shape[-1]]
        if not left.size:
            break
    return np.swapaxes(coefficients, -1, -2)


@dataclass(frozen=True)
class Split:
    """A change of calibration in the middle of a run.

    dwell : index of the first dwell after it; before, after : (4, 3), output unit, bias and response on both sides
    """

    dwell: int
    before: Array
    after: Array

    @property
    def ratio(self) -> float:
        """Scale after over scale before."""
        before, after = (float(np.sqrt(np.sum(k[1:] ** 2))) for k in (self.before, self.after))
        return after / max(before, 1e-300)


_LEAST = 6  # dwells on either side of a split: a response and a bias need four
_BETTER = 0.05  # largest ratio of the sum of squares of two fits to that of one
_FAR = 4.0  # multiple of that ratio above which rounding cannot hide a split
_FIXED = 1e-9  # relative eigenvalue of the Gram matrix below which the poses do not determine a direction


def find_split(force: Array, output: Array) -> Split | None:
    """The split of a run into two parts with different calibrations; None if one calibration suffices.

    Two fits must leave less than a twentieth of the sum of squares of one, and differ by more than a hundredth of the scale: no
    physical effect changes a sensor as much.
    """
    there = np.flatnonzero(np.isfinite(output).all(axis=-1))
    if there.size < 2 * _LEAST + 1:
        return None
    f, y = force[there], output[there]
    total = _plain_fit(f, y)[1]
    cuts = np.arange(_LEAST, there.size - _LEAST)
    if _far_from_split(f, y, cuts):
        return None
    coarse = cuts[:: max(1, cuts.size // 24)]
    errors = [_plain_fit(f[:p], y[:p])[1] + _plain_fit(f[p:], y[p:])[1] for p in coarse]
    centre = int(coarse[int(np.argmin(errors))])
    near = cuts[np.abs(cuts - centre) <= max(1, cuts.size // 24)]
    errors = [_plain_fit(f[:p], y[:p])[1] + _plain_fit(f[p:], y[p:])[1] for p in near]
    best = int(near[int(np.argmin(errors))])
    before, after = _plain_fit(f[:best], y[:best])[0], _plain_fit(f[best:], y[best:])[0]
    apart = float(np.max(np.abs(after - before))) > 0.01 * float(np.sqrt(np.sum(before[1:] ** 2) / before.shape[1]))
    return Split(int(there[best]), before, after) if min(errors) < _BETTER * total and apart else None


def _far_from_split(force: Array, output: Array, cuts: Places) -> bool:
    """Whether no split at the dwells ``cuts`` (k,) comes near the required ratio, by cumulative Gram matrices."""
    x = design(force)
    left = output - x @ np.linalg.lstsq(x, output, rcond=1e-9)[0]
    both = np.concatenate([x, left], axis=-1)
    before = np.cumsum(both[:, :, None] * both[:, None, :], axis=0)
    squares = np.zeros(len(cuts))
    for gram in (before[cuts - 1], before[-1] - before[cuts - 1]):
        values, vectors = np.linalg.eigh(gram[:, :4, :4])
        along = np.swapaxes(vectors, -1, -2) @ gram[:, :4, 4:]
        known = values > _FIXED * values[:, -1:]
        taken = np.sum(along**2, axis=2) / np.where(known, values, np.inf)
        squares += np.einsum("kjj->k", gram[:, 4:, 4:]) - taken.sum(axis=1)
    return bool(squares.min() > _FAR * _BETTER * np.sum(left**2))


def _plain_fit(force: Array, output: Array) -> tuple[Array, float]:
    """Least-squares bias and response (4, 3), output unit, and the residual sum of squares."""
    x = design(force)
    coefficients = np.linalg.lstsq(x, output, rcond=1e-9)[0].astype(np.float64)
    return coefficients, float(np.sum((output - x @ coefficients) ** 2))


def exchanged(split: Split, other: Split) -> bool:
    """Whether two units exchanged their calibrations at the same dwell, within two dwells."""
    if abs(split.dwell - other.dwell) > 2:
        return False
    apart = float(np.linalg.norm(split.after - split.before)) + float(np.linalg.norm(other.after - other.before))
    crossed = float(np.linalg.norm(split.after - other.before)) + float(np.linalg.norm(other.after - split.before))
    return crossed < 0.3 * apart
