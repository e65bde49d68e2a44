"""What a plan can see: the part of every effect that the base model leaves, its floor, and what it is mistaken for.

The same columns that fit and diagnose decide, before any chamber time is spent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial import design
from inertial import effects as catalogue
from inertial.effects import SensorEffect
from inertial.effects.base import AnyEffect, excited
from inertial.errors import MissingInput
from inertial.noise.dwells import whitener
from inertial.state import State

Array = NDArray[np.float64]

SEEN = 0.01
"""Part v below which an effect is taken as unseen."""

ALIAS = 0.98
"""Cosine of two effects' remaining columns above which the plan does not tell them apart."""

_BASE = ("bias", "scale", "misalignment")


@dataclass(frozen=True)
class Visibility:
    """How a plan sees one effect.

    left : v, RMS of the column after the base model over its RMS, 0 … 1; the best of its columns, axes and nonlinear values
    by_axis : v per sensor axis, (3,)
    floor : three-sigma floor of the coefficient, g per unit of the coefficient; infinite where unseen
    column : which of the effect's columns that coefficient belongs to
    size : RMS over the dwells of what an effect of the floor's size adds, g; infinite where unseen
    alias : effects that it is not told from; exact : those of them with which it is one, to rounding
    """

    effect: str
    seen: bool
    left: float
    by_axis: tuple[float, float, float]
    floor: float
    alias: tuple[str, ...]
    breaker: str
    exact: tuple[str, ...] = ()
    column: int = 0
    size: float = float("inf")

    @property
    def variance_inflation(self) -> float:
        """1/v²; infinite where unseen."""
        return 1.0 / self.left**2 if self.left > 0.0 else float("inf")


EXACT = 1.0 - 1e-9
"""Cosine from which two effects are one and the same under a plan."""


def sights(
    state: State,
    base: Sequence[str],
    error: float,
    candidates: Sequence[str] | None = None,
    *,
    covariance: Array | None = None,
) -> list[Visibility]:
    """How a plan sees every effect of the catalogue that is not in the base model.

    Parameters
    ----------
    state : the planned dwells of one unit, (n,)
    base : ids of the model that is fitted anyway
    error : standard error of a dwell mean, g
    candidates : ids to look at; the whole catalogue otherwise
    covariance : (n, n), of the dwell means, g²: the floors are then those of a generalised fit; white of ``error`` where None
    """
    span = _span(state, base)
    noise = None if covariance is None else _Noise(state, base, whitener(covariance))
    names = [n for n in (candidates or catalogue.catalogue()) if n not in set(base)]
    found: dict[str, _Remainder | None] = {}
    for name in names:
        found[name] = _remainder(catalogue.get(name), state, span)
    aliases = alias_cosines({n: r for n, r in found.items() if r is not None and r.left > SEEN})
    return [_sight(n, found[n], error if noise is None else noise, aliases.get(n, {})) for n in names]


def likeness(
    state: State, base: Sequence[str], candidates: Sequence[str] | None = None
) -> tuple[tuple[str, ...], Array]:
    """The effects that a plan sees, and the cosine (m, m) of what each leaves with the span of each other, 0 … 1.

    Row by column: how far the row's effect lies within the column's; the lowest over the sensor axes that see it.
    """
    span = _span(state, base)
    names = [n for n in (candidates or catalogue.catalogue()) if n not in set(base)]
    found = {n: _remainder(catalogue.get(n), state, span) for n in names}
    cosines = alias_cosines({n: r for n, r in found.items() if r is not None and r.left > SEEN})
    seen = tuple(cosines)
    return seen, np.array([[1.0 if a == b else cosines[a][b] for b in seen] for a in seen]).reshape(
        len(seen), len(seen)
    )


class _Noise:
    """Base model and columns whitened by the covariance of the dwell means."""

    def __init__(self, state: State, base: Sequence[str], white: Array) -> None:
        self._white = white
        self._span = _span(state, base, white)

    def information(self, columns: Array) -> Array:
        """Information (3, p) that columns (3, n, p) have beside the base model, square root, 1/g."""
        own = self._white @ columns
        left = own - self._span @ (np.swapaxes(self._span, -1, -2) @ own)
        return np.linalg.norm(left, axis=-2)


@dataclass(frozen=True)
class _Remainder:
    """Columns of an effect after the base model on the axis that sees it best, (3, n, p) over all axes."""

    left: float
    by_axis: tuple[float, float, float]
    columns: Array
    before: Array


def _span(state: State, base: Sequence[str], white: Array | None = None) -> Array:
    """Orthonormal bases of the base model per axis, (3, n, p); of the whitened columns where a whitener is given."""
    sensor, _ = design.split(base or _BASE)
    columns = design.local_columns(sensor, state, design.starting_values(sensor, state))
    columns = columns if white is None else white @ columns
    size = np.linalg.norm(columns, axis=-2, keepdims=True)
    u, s, _ = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return u * (s > 1e-9)[..., None, :]


def _remainder(effect: AnyEffect, state: State, span: Array) -> _Remainder | None:
    """What the base model leaves of an effect, at the nonlinear values that leave most; None where it lacks input."""
    best: _Remainder | None = None
    try:
        for values in _values(effect, state):
            columns = _columns(effect, state, values)
            found = _measured(columns, _after(span, columns, _start(effect, state, values)))
            best = found if best is None else _better(best, found)
    except MissingInput:
        return None
    return best


def _after(span: Array, columns: Array, start: Array) -> Array:
    """What the base model leaves of columns (3, n, p), and besides it the unknown state of a memory at the start (3, n, k)."""
    left = columns - span @ (np.swapaxes(span, -1, -2) @ columns)
    if not start.shape[-1]:
        return left
    begin = start - span @ (np.swapaxes(span, -1, -2) @ start)
    u, s, _ = np.linalg.svd(begin, full_matrices=False)
    u = u * (s > 1e-9)[..., None, :]
    return left - u @ (np.swapaxes(u, -1, -2) @ left)


def _better(one: _Remainder, other: _Remainder) -> _Remainder:
    """Of two values of the nonlinear parameters the one that is left most, with the columns of the one with the lower floor."""
    more = one if one.left >= other.left else other
    clearer = max((one, other), key=lambda r: float(np.max(np.linalg.norm(r.columns, axis=-2))))
    return _Remainder(more.left, more.by_axis, clearer.columns, clearer.before)


def _measured(columns: Array, after: Array) -> _Remainder:
    before = np.linalg.norm(columns, axis=-2)
    rest = np.linalg.norm(after, axis=-2)
    v = np.where(before > 1e-12, rest / np.where(before > 1e-12, before, 1.0), 0.0)
    v = np.where(v < 1e-6, 0.0, v)
    by_axis = v.max(axis=-1)
    return _Remainder(float(v.max()), (float(by_axis[0]), float(by_axis[1]), float(by_axis[2])), after, before)


def _values(effect: AnyEffect, state: State) -> list[Mapping[str, float]]:
    from inertial.design import grid_of  # noqa: PLC0415  # criticism stands above planning elsewhere

    return list(grid_of(effect, state))


def _start(effect: AnyEffect, state: State, values: Mapping[str, float]) -> Array:
    """What the state of a memory before the first dwell would add, (3, n, k): nobody knows it, so it is no information."""
    if isinstance(effect, SensorEffect):
        axes = [effect.start_columns(state, axis, **values) for axis in range(3)]
        return np.stack([np.broadcast_to(c, (*state.time.shape, c.shape[-1])) for c in axes])
    return np.moveaxis(effect.start_change(state, **values), -2, 0)


def _columns(effect: AnyEffect, state: State, values: Mapping[str, float]) -> Array:
    """Columns per axis, (3, n, p)."""
    if isinstance(effect, SensorEffect):
        axes = [excited(effect, effect.columns(state, axis, **values)) for axis in range(3)]
        return np.stack([np.broadcast_to(c, (*state.time.shape, c.shape[-1])) for c in axes])
    return np.moveaxis(effect.force_change(state, **values), -2, 0)


def _sight(name: str, found: _Remainder | None, noise: float | _Noise, cosines: Mapping[str, float]) -> Visibility:
    breaker = catalogue.get(name).breaker
    alias = tuple(other for other, cosine in cosines.items() if cosine > ALIAS)
    exact = tuple(other for other in alias if cosines[other] > EXACT)
    if found is None or found.left <= SEEN:
        return Visibility(
            name, False, 0.0 if found is None else found.left, (0.0, 0.0, 0.0), float("inf"), alias, breaker
        )
    if isinstance(noise, _Noise):
        information = noise.information(found.columns)
    else:
        information = np.linalg.norm(found.columns, axis=-2) / noise
    seen = information > 1e-9 * np.max(information, initial=0.0)
    size = 3.0 * found.before / np.sqrt(found.columns.shape[-2]) / np.where(seen, information, 1.0)
    # of columns in different units the one is meant of which the least has to be there
    axis, column = np.unravel_index(int(np.argmin(np.where(seen, size, np.inf))), size.shape)
    floor = 3.0 / float(information[axis, column])
    return Visibility(
        name, True, found.left, found.by_axis, floor, alias, breaker, exact, int(column), float(size[axis, column])
    )


def alias_cosines(seen: Mapping[str, _Remainder]) -> dict[str, dict[str, float]]:
    """How far effects' remaining columns lie within one another's span: the least cosine over directions and axes."""
    spans: dict[str, Array] = {}
    for name, found in seen.items():
        size = np.linalg.norm(found.columns, axis=-2, keepdims=True)
        u, s, _ = np.linalg.svd(found.columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
        spans[name] = u * (s > SEEN)[..., None, :]
    return {name: {o: _inside(spans[name], spans[o]) for o in spans if o != name} for name in spans}


def _inside(one: Array, other: Array) -> float:
    """Least cosine of a direction of one effect with the other's span, over every axis that sees it."""
    inner = np.linalg.norm(np.swapaxes(other, -1, -2) @ one, axis=-2)
    there = np.linalg.norm(one, axis=-2) > 0.5
    return float(np.min(inner[there], initial=1.0)) if there.any() else 0.0
