"""The common part of the residuals of all units of a run: the station's errors, by effects of the catalogue.

Residuals of a unit contain the errors outside its model. Errors common to all units of a run come from the station. Each
effect of the station is fitted alone to the mean residual, after both are projected orthogonally to the units' model, so that
the weights of the run's own fit have no influence.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial import design, effects
from inertial.arrays import Array
from inertial.effects import SensorEffect, StationEffect
from inertial.errors import InertialError, MissingInput
from inertial.state import State

FEWEST_UNITS = 3  # with fewer units a single outlier could be attributed to the station
SEEN = 0.02  # share of an effect's columns outside the units' model; a smaller share cannot be separated from the units
ALIKE = 0.98  # effects with a larger correlation of their projected columns are the same


class StationValue(NamedTuple):
    """One parameter of one station effect in one run: µrad for angles, in general millionths of its own unit."""

    effect: str
    name: str
    value: float
    error: float


def station_values(
    residuals: Mapping[str, NDArray[Any]], recipe: Mapping[str, Any], model: Sequence[str]
) -> list[StationValue]:
    """Parameters of the station's effects in a run; empty with too few units, angles or dwells.

    Parameters
    ----------
    residuals : columns of the table, ordered by unit, dwell and axis; units as numbers
    recipe : of the run, with the poses' angles by name
    model : effects of the run's fit
    """
    grid = _grid(residuals)
    if grid is None:
        return []
    mean, state = grid
    angles = {p["name"]: (p["outer_deg"], p["inner_deg"]) for p in (*recipe["poses"], *recipe.get("verification", ()))}
    poses = np.asarray(residuals["pose"])[: mean.size : 3]
    if not set(poses.tolist()) <= angles.keys():
        return []
    outer, inner = np.radians(np.array([angles[pose] for pose in poses])).T
    known = [name for name in model if not isinstance(_effect(name), StationEffect)]
    return _fitted(mean, replace(state, outer=outer, inner=inner, memory={}), known)


def followed() -> list[StationEffect]:
    """The effects of the station for the audit: without nonlinear parameters, more general ones first."""
    chosen = [e for e in effects.catalogue().values() if isinstance(e, StationEffect) and not e.nonlinear]
    return sorted(chosen, key=lambda effect: (-len(effect.names()), effect.simplicity, effect.id))


def _effect(name: str) -> object:
    try:
        return effects.get(name)
    except InertialError:
        return None  # an effect of a model file that is not available


def _grid(residuals: Mapping[str, NDArray[Any]]) -> tuple[Array, State] | None:
    """Mean residual over the units, (n, 3) in µg, and the dwells' state; None where units have different dwells."""
    dwell = np.asarray(residuals["dwell"])
    units, n = np.unique(residuals["unit"]).size, np.unique(dwell).size
    if units < FEWEST_UNITS or dwell.size != units * n * 3:
        return None
    shape = (units, n, 3)
    force = np.asarray(residuals["force_g"], dtype=float).reshape(shape)[0]
    temperature = np.asarray(residuals["unit_C"], dtype=float).reshape(shape)[:, :, 0].mean(axis=0)
    by_unit = np.asarray(residuals["residual_ug"], dtype=float).reshape(shape)
    known = bool(np.isfinite(temperature).all())
    time = np.arange(n, dtype=float)
    return by_unit.mean(axis=0), State(force=force, time=time, temperature=temperature if known else None)


class _PlanProjection(NamedTuple):
    """The columns of the units' model by axis, and for each effect its projected columns with their inverse."""

    bases: list[Array]
    effects: list[tuple[StationEffect, Array, Array]]
    spare: int


_projections: dict[tuple[object, ...], _PlanProjection] = {}


def _plan_projection(exact: State, model: Sequence[str]) -> _PlanProjection:
    """The projected columns of a plan; computed once for all runs of a recipe whose temperatures agree within a kelvin.

    It is computed from the rounded state, so that the values of a run do not depend on earlier runs.
    """
    state = _rounded(exact)
    parts = (state.force, state.temperature, state.outer, state.inner)
    key = (tuple(model), *(b"" if part is None else np.asarray(part).tobytes() for part in parts))
    if key not in _projections:
        bases = _bases(state, model)
        projected: list[tuple[StationEffect, Array, Array]] = []
        for effect in followed():
            columns = _projected(effect, state, bases)
            if columns is not None and not any(_alike(columns, other) for _, other, _ in projected):
                inverse = np.asarray(np.linalg.inv(columns.T @ columns), dtype=np.float64)
                projected.append((effect, columns, inverse))
        _projections[key] = _PlanProjection(
            bases, projected, 3 * state.time.size - sum(base.shape[1] for base in bases)
        )
    return _projections[key]


def _rounded(state: State) -> State:
    """The state rounded to a milli-g, a kelvin and 10 µrad; zeros have no sign."""
    temperature = None if state.temperature is None else np.round(state.temperature) + 0.0
    angles = {name: np.round(getattr(state, name), 5) + 0.0 for name in ("outer", "inner")}
    return replace(state, force=np.round(state.force, 3) + 0.0, temperature=temperature, **angles)


def _fitted(mean: Array, state: State, model: Sequence[str]) -> list[StationValue]:
    seen = _plan_projection(state, model)
    target = np.concatenate([_without(mean[:, axis], seen.bases[axis]) for axis in range(3)])
    out: list[StationValue] = []
    for effect, columns, inverse in seen.effects:
        values = inverse @ (columns.T @ target)
        left = target - columns @ values
        errors = np.sqrt(np.diagonal(inverse) * float(left @ left) / max(seen.spare - values.size, 1))
        out += [
            StationValue(effect.id, n, float(v), float(e))
            for n, v, e in zip(effect.names(), values, errors, strict=True)
        ]
    return out


def _bases(state: State, model: Sequence[str]) -> list[Array]:
    """Orthonormal columns of the units' model on each axis, (n, p)."""
    effects = [e for name in model if isinstance(e := _effect(name), SensorEffect)]
    while True:
        try:
            columns = design.local_columns(effects, state, design.starting_values(effects, state))
            break
        except MissingInput as lack:  # components that the residuals do not have are not projected out
            effects = [e for e in effects if e.id != lack.effect]
    return [np.linalg.qr(columns[axis])[0] for axis in range(3)]


def _without(values: Array, base: Array) -> Array:
    return values - base @ (base.T @ values)


def _projected(effect: StationEffect, state: State, bases: list[Array]) -> Array | None:
    """Columns of an effect (3n, q) projected orthogonally to the units' model; None without a remainder or a quantity."""
    try:
        change = effect.force_change(state, **design.starting_values([effect], state).get(effect.id, {}))
    except MissingInput:
        return None
    columns = np.concatenate([change[:, axis, :] for axis in range(3)])
    left = np.concatenate([_without(change[:, axis, :], bases[axis]) for axis in range(3)])
    singular = np.linalg.svd(left, compute_uv=False)
    return left if singular[-1] > SEEN * np.linalg.norm(columns) else None


def _alike(columns: Array, other: Array) -> bool:
    """Whether a linear combination of the columns is nearly equal to one of the other columns."""
    ours, theirs = np.linalg.qr(columns)[0], np.linalg.qr(other)[0]
    return bool(np.linalg.svd(ours.T @ theirs, compute_uv=False)[0] > ALIKE)
