"""Visibility of effects under a plan: remaining fraction after the base model, detection floor, and confounded effects.

Computed before the measurement from the same columns that the fit and the diagnosis use.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial import design
from inertial import effects as catalogue
from inertial.arrays import Array
from inertial.design import of_axes
from inertial.effects import SensorEffect
from inertial.effects.base import AnyEffect, excited
from inertial.errors import MissingInput
from inertial.noise.dwells import whitener
from inertial.planning.ranges import UnseenRange, unseen_ranges
from inertial.state import State

SEEN = 0.01
"""Remaining fraction v up to which an effect counts as not visible."""

ALIAS = 0.98
"""Cosine of two effects' remaining columns above which they are confounded under the plan."""

_BASE = ("bias", "scale", "misalignment")


@dataclass(frozen=True)
class Visibility:
    """Visibility of one effect under a plan.

    remaining_fraction : v, RMS of the column after the base model over its RMS, 0 … 1; the largest over columns, axes and
        nonlinear values
    by_axis : v per sensor axis with an output
    floor : three standard errors of the coefficient, g per unit of the coefficient; infinite where not visible
    column : index of the effect's column that has this floor
    size : RMS over the dwells of an effect of the floor's size, g; infinite where not visible
    alias : confounded effects; exact : those of them that are identical to rounding
    breaker : measurement that separates the effect from those it is confounded with
    unseen_ranges : values of its nonlinear parameters at which it is not visible, where it is at others
    """

    effect: str
    seen: bool
    remaining_fraction: float
    by_axis: tuple[float, ...]
    floor: float
    alias: tuple[str, ...]
    breaker: str
    exact: tuple[str, ...] = ()
    column: int = 0
    size: float = float("inf")
    unseen_ranges: tuple[UnseenRange, ...] = ()

    @property
    def variance_inflation(self) -> float:
        """1/v²; infinite where not visible."""
        return 1.0 / self.remaining_fraction**2 if self.remaining_fraction > 0.0 else float("inf")


EXACT = 1.0 - 1e-9
"""Cosine above which two effects are identical under a plan, to rounding."""


def visibilities(
    state: State,
    base: Sequence[str],
    error: float,
    candidates: Sequence[str] | None = None,
    *,
    covariance: Array | None = None,
) -> list[Visibility]:
    """Visibility of every effect of the catalogue that is not in the base model.

    Parameters
    ----------
    state : the planned dwells of one unit, (n,)
    base : ids of the base model
    error : standard error of a dwell mean, g
    candidates : ids of the effects; the whole catalogue where None
    covariance : (n, n), of the dwell means, g², for the floors of a generalised fit; white noise of ``error`` where None
    """
    information = _information(state, base, error, covariance)
    names = [n for n in (candidates or catalogue.catalogue()) if n not in set(base)]
    remainders, aliases = _beside(state, base, names)
    return [_visibility(n, remainders[n], information, aliases.get(n, {}), len(state.axes)) for n in names]


def confounding(state: State, base: Sequence[str]) -> tuple[tuple[str, ...], Array]:
    """The visible effects, and the cosines (m, m) of their remaining columns with the span of the others', 0 … 1.

    Row by column: cosine of the row's effect with the span of the column's; the smallest over the axes where it is visible.
    """
    cosines = _beside(state, base, [n for n in catalogue.catalogue() if n not in set(base)])[1]
    seen = tuple(cosines)
    square = np.array([[1.0 if a == b else cosines[a][b] for b in seen] for a in seen])
    return seen, square.reshape(len(seen), len(seen))


def _beside(
    state: State, base: Sequence[str], names: Sequence[str]
) -> tuple[dict[str, "_Remainder | None"], dict[str, dict[str, float]]]:
    """What the base model leaves of effects, and the cosines of those that are visible."""
    span = _span(state, base)
    remainders = {name: _remainder(catalogue.get(name), state, span) for name in names}
    seen = {n: r for n, r in remainders.items() if r is not None and r.remaining_fraction > SEEN}
    return remainders, alias_cosines(seen)


Information = Callable[[Array], Array]


def _information(state: State, base: Sequence[str], error: float, covariance: Array | None) -> Information:
    """Root of the information (3, p), 1/g, of columns (3, n, p) beside the base model.

    For white noise of an error, g, or for dwell means with a covariance.
    """
    if covariance is None:
        return lambda columns: np.linalg.norm(columns, axis=-2) / error
    white = whitener(covariance)
    span = _span(state, base, white)
    return lambda columns: np.linalg.norm(_orthogonal_part(span, white @ columns), axis=-2)


def _orthogonal_part(span: Array, columns: Array) -> Array:
    """Columns (3, n, p) without their part in a span (3, n, q)."""
    return columns - span @ (np.swapaxes(span, -1, -2) @ columns)


def _basis(columns: Array, least: float) -> Array:
    """Orthonormal bases (3, n, p) of columns per axis; directions with singular values up to ``least`` are zero."""
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u * (s > least)[..., None, :]


def _unit(columns: Array) -> Array:
    size = np.linalg.norm(columns, axis=-2, keepdims=True)
    return columns / np.where(size > 0.0, size, 1.0)


@dataclass(frozen=True)
class _Remainder:
    """Columns (3, n, p) of an effect after the base model, and their remaining fraction."""

    remaining_fraction: float
    by_axis: tuple[float, ...]
    columns: Array
    before: Array
    unseen: tuple[UnseenRange, ...] = ()


def _span(state: State, base: Sequence[str], white: Array | None = None) -> Array:
    """Orthonormal bases of the base model's columns per axis, (3, n, p); of the whitened columns where a whitener is given."""
    sensor, _ = design.split(base or _BASE)
    columns = design.local_columns(sensor, state, design.starting_values(sensor, state))
    return _basis(_unit(columns if white is None else white @ columns), 1e-9)


def _remainder(effect: AnyEffect, state: State, span: Array) -> _Remainder | None:
    """Columns after the base model at the nonlinear values with the largest remainder; None where an input is missing."""
    best: _Remainder | None = None
    seen: list[bool] = []
    try:
        for values in design.resting_grid(effect, state):
            columns = _columns(effect, state, values)
            remainder = _measured(columns, _after(span, columns, _start(effect, state, values)))
            seen.append(remainder.remaining_fraction > SEEN)
            best = remainder if best is None else _better(best, remainder)
    except MissingInput:
        return None
    return None if best is None else replace(best, unseen=unseen_ranges(effect, state, seen))


def _after(span: Array, columns: Array, start: Array) -> Array:
    """Columns (3, n, p) after the base model and after the unknown initial state of a memory (3, n, k)."""
    remainder = _orthogonal_part(span, columns)
    return _orthogonal_part(_basis(_orthogonal_part(span, start), 1e-9), remainder) if start.shape[-1] else remainder


def _better(first: _Remainder, second: _Remainder) -> _Remainder:
    """The larger remaining fraction of two nonlinear values, with the columns of the one with the lower floor."""
    more = first if first.remaining_fraction >= second.remaining_fraction else second
    clearer = max((first, second), key=lambda r: float(np.max(np.linalg.norm(r.columns, axis=-2))))
    return _Remainder(more.remaining_fraction, more.by_axis, clearer.columns, clearer.before)


def _measured(columns: Array, after: Array) -> _Remainder:
    before = np.linalg.norm(columns, axis=-2)
    rest = np.linalg.norm(after, axis=-2)
    v = np.where(before > 1e-12, rest / np.where(before > 1e-12, before, 1.0), 0.0)
    v = np.where(v < 1e-6, 0.0, v)
    by_axis = v.max(axis=-1)
    return _Remainder(float(v.max()), tuple(by_axis.tolist()), after, before)


def _start(effect: AnyEffect, state: State, values: Mapping[str, float]) -> Array:
    """Columns (3, n, k) of the unknown state of a memory before the first dwell."""
    if isinstance(effect, SensorEffect):
        return _stacked(state, [effect.start_columns(state, axis, **values) for axis in state.axes])
    return np.moveaxis(of_axes(effect.start_change(state, **values), state.axes, -2), -2, 0)


def _columns(effect: AnyEffect, state: State, values: Mapping[str, float]) -> Array:
    """Columns per axis, (3, n, p)."""
    if isinstance(effect, SensorEffect):
        return _stacked(state, [excited(effect, effect.columns(state, axis, **values)) for axis in state.axes])
    return np.moveaxis(of_axes(effect.force_change(state, **values), state.axes, -2), -2, 0)


def _stacked(state: State, axes: Sequence[Array]) -> Array:
    return np.stack([np.broadcast_to(c, (*state.time.shape, c.shape[-1])) for c in axes])


def _visibility(
    name: str, remainder: _Remainder | None, information_of: Information, cosines: Mapping[str, float], axes: int
) -> Visibility:
    breaker = catalogue.get(name).breaker
    alias = tuple(other for other, cosine in cosines.items() if cosine > ALIAS)
    exact = tuple(other for other in alias if cosines[other] > EXACT)
    if remainder is None or remainder.remaining_fraction <= SEEN:
        fraction = 0.0 if remainder is None else remainder.remaining_fraction
        return Visibility(name, False, fraction, (0.0,) * axes, float("inf"), alias, breaker)
    information = information_of(remainder.columns)
    seen = information > 1e-9 * np.max(information, initial=0.0)
    size = 3.0 * remainder.before / np.sqrt(remainder.columns.shape[-2]) / np.where(seen, information, 1.0)
    # columns may have different units: take the one with the smallest detectable contribution
    axis, column = np.unravel_index(int(np.argmin(np.where(seen, size, np.inf))), size.shape)
    floor, least = 3.0 / float(information[axis, column]), float(size[axis, column])
    fraction, by_axis, unseen = remainder.remaining_fraction, remainder.by_axis, remainder.unseen
    return Visibility(name, True, fraction, by_axis, floor, alias, breaker, exact, int(column), least, unseen)


def alias_cosines(seen: Mapping[str, _Remainder]) -> dict[str, dict[str, float]]:
    """Cosine of each effect's remaining columns with the span of every other's: the smallest over directions and axes."""
    spans = {name: _basis(_unit(remainder.columns), SEEN) for name, remainder in seen.items()}
    return {name: {o: _inside(spans[name], spans[o]) for o in spans if o != name} for name in spans}


def _inside(directions: Array, span: Array) -> float:
    """Smallest cosine of a direction of one effect with the other's span, over the axes where it is visible."""
    inner = np.linalg.norm(np.swapaxes(span, -1, -2) @ directions, axis=-2)
    there = np.linalg.norm(directions, axis=-2) > 0.5
    return float(np.min(inner[there], initial=1.0)) if there.any() else 0.0
