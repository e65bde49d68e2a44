"""Drivers of the residual: smooth dependence on every recorded quantity."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations_with_replacement
from typing import Literal

import numpy as np

from inertial.arrays import Array
from inertial.design import of_axes
from inertial.effects.base import AXES
from inertial.estimation.candidate import Candidate
from inertial.estimation.penalty import log_p_value
from inertial.estimation.problem import Problem
from inertial.estimation.space import Space
from inertial.quantities import attribute_drivers, is_clock
from inertial.splines import natural_spline
from inertial.state import ALL_AXES, State

_KNOTS = 5
_TIME_KNOTS = 8
_BENT_KNOTS = 3
_TRANSFER_KNOTS = 4
_DIGITS = 6
"""Decimals to which logarithms of probabilities and shares are compared."""

_CERTAIN = -600.0
"""Logarithm of a probability below which drivers are ranked by the share that they explain."""

Part = Literal["bias", "scale", "axes", "transfer"]
"""The property of an output that depends on a driver: bias, scale factor, directions of the axes, or transfer curve."""


@dataclass(frozen=True)
class Driver:
    """Columns of a smooth dependence on one driver.

    name : as in the exchange format (``unit_C``, ``time_s``, a covariate), or ``pose``, ``approach``, ``temperature_rate``
    make : function that computes the columns
    values : (units, n), values of the driver; of a suspect (blocks, n), scaled to 0 … 1; None if it is not a single quantity
    part : property of the output that depends on the driver
    ways : number of column groups of each block with separate sizes (such as two cross axes), group after group
    period : s, period of an oscillation in time; None for any other curve
    """

    name: str
    make: Callable[[], Candidate]
    values: Array | None = None
    part: Part = "bias"
    ways: int = 1
    period: float | None = None

    @property
    def candidate(self) -> Candidate:
        """The columns as a candidate, computed at each use: in a large lot those of all drivers take hundreds of megabytes."""
        return self.make()


@dataclass(frozen=True)
class Misfit:
    """A driver of the residuals, the affected axes, and the share of their excess over noise that it explains."""

    driver: str
    axes: tuple[str, ...]
    share: float
    log_p: float
    rank: int
    drop: float


def drivers_of(problem: Problem) -> list[Driver]:
    """Every driver that varies in a lot."""
    state = problem.lot.state
    drivers = [
        Driver(name, partial(_by_block, problem, curve(values, knots)), values)
        for name, values, knots in quantities(state)
        if varies(values)
    ]
    pose = _pose_columns(state, most=max(4, (problem.n - 8) // 3))
    if pose.shape[-1]:
        drivers.append(Driver("pose", partial(_by_block, problem, pose)))
    approach = np.tanh(state.force_step / 0.05)
    if np.any(np.abs(approach) > 0.1):
        drivers.append(Driver("approach", partial(_by_axis, problem, approach)))
    return drivers


def looks_of(problem: Problem) -> list[Driver]:
    """All drivers, with drivers of axis directions and of the transfer curve: a bending fixture does not change any bias.

    Axis directions may depend on time and unit temperature, the transfer curve on temperature; no other dependence is tested,
    because each test reduces the power of all others.
    """
    looks = drivers_of(problem)
    if problem.lot.radial:
        return looks
    state = problem.lot.state
    for name, values in (("unit_C", state.temperature), ("time_s", state.time)):
        if values is not None and varies(values):
            looks.append(Driver(name, partial(_across_axes, problem, values), part="axes"))
    if state.temperature is not None and varies(state.temperature) and varies(own_forces(problem)):
        looks.append(Driver("unit_C", partial(_transfer_curve, problem, state.temperature), part="transfer"))
    return looks


def _across_axes(problem: Problem, values: Array) -> Candidate:
    along, values = _of_one_unit(problem, values)
    return _of_axes(problem, across(along, curve(values, _BENT_KNOTS), problem.axes))


def _transfer_curve(problem: Problem, values: Array) -> Candidate:
    along, values = _of_one_unit(problem, values)
    return _of_axes(problem, transfer(of_axes(along, problem.axes, 1), values, _TRANSFER_KNOTS))


def _of_axes(problem: Problem, columns: Array) -> Candidate:
    """Columns (blocks or 3, n, d): of all blocks, or of the three axes where all units have equal ones."""
    rows = None if len(columns) == problem.blocks else np.arange(problem.blocks) % problem.per_unit
    return Candidate(columns[:, :, None, :], shared=False, rows=rows)


def _of_one_unit(problem: Problem, values: Array) -> tuple[Array, Array]:
    """Forces and the mean of a quantity for one unit instead of all units, where the forces are equal in all of them."""
    along = forces_along(problem)
    same = bool(np.all(along == along[:1]))
    return (along[:1], values.mean(axis=0, keepdims=True)) if same else (along, values)


def forces_along(problem: Problem) -> Array:
    """The force along each of the three axes, measured or not, (units, 3, n), g."""
    along = np.stack([problem.lot.state.along(axis) for axis in range(3)], axis=1)
    return np.broadcast_to(along, (problem.blocks // problem.per_unit, 3, problem.n))


def own_forces(problem: Problem) -> Array:
    """The force along each measured axis, (units, axes, n), g."""
    return of_axes(forces_along(problem), problem.axes, 1)


def transfer(along: Array, values: Array, knots: int) -> Array:
    """Spline columns (axes · units, n, d) of forces (units, axes, n), times a centred quantity (units or 1, n)."""
    middle = 0.5 * (float(np.max(values)) + float(np.min(values)))
    each = (values - middle) / max(float(np.ptp(values)), 1e-12)
    columns = curve(along, knots) * each[:, None, :, None]
    return columns.reshape(-1, *columns.shape[2:])


def across(along: Array, columns: Array, axes: tuple[int, ...] = ALL_AXES) -> Array:
    """Columns (units or 1, n, d) times the two forces across each axis, from ``along`` (units, 3, n): (blocks, n, 2 d)."""
    wide = [of_axes(np.roll(along, -way, axis=1), axes, 1)[..., None] * columns[:, None] for way in (1, 2)]
    return np.concatenate([w.reshape(-1, *w.shape[2:]) for w in wide], axis=-1)


def quantities(state: State) -> list[tuple[str, Array, int]]:
    """Name, values (units, n) and number of knots of every recorded quantity."""
    fields = {name: getattr(state, attribute) for name, attribute in attribute_drivers().items()}
    every: Mapping[str, Array | None] = {**fields, **state.covariates}
    return [(k, v, _TIME_KNOTS if is_clock(k) else _KNOTS) for k, v in every.items() if v is not None]


def varies(values: Array) -> bool:
    """Whether a quantity takes more than one value."""
    return bool(np.ptp(values) > 1e-9 * max(1.0, float(np.max(np.abs(values)))))


def curve(values: Array, knots: int) -> Array:
    """Natural cubic spline basis (..., n, d) of a driver, knots at its quantiles, d ≤ ``knots``; a line for few values."""
    low, high = float(np.min(values)), float(np.max(values))
    z = (values - low) / max(high - low, 1e-12)
    distinct = np.unique(np.round(z, 6))
    if distinct.size <= 3:
        return np.stack([z**k for k in range(1, distinct.size)], axis=-1)
    at = np.unique(np.quantile(distinct, np.linspace(0.0, 1.0, min(knots + 1, distinct.size))))
    return np.stack([z, *natural_spline(z, at)], axis=-1)


def _pose_columns(state: State, most: int) -> Array:
    """Polynomials of the direction of gravity, complete degrees from 2 to 4 with at most ``most`` columns, (units, n, d)."""
    columns: list[Array] = []
    f = np.moveaxis(state.force, -1, 0)
    for degree in (2, 3, 4):
        terms = [np.prod(f[list(c)], axis=0) for c in combinations_with_replacement(range(3), degree)]
        # on the sphere x² + y² + z² = 1: terms with z² are sums of lower ones
        keep = [
            t for t, c in zip(terms, combinations_with_replacement(range(3), degree), strict=True) if c.count(2) < 2
        ]
        if len(columns) + len(keep) > most:
            break
        columns.extend(keep)
    return np.stack(columns, axis=-1) if columns else np.zeros((*state.force.shape[:-1], 0))


def _by_block(problem: Problem, columns: Array) -> Candidate:
    """Columns (units, n, d), equal on every axis, as a candidate."""
    axes = problem.blocks // len(problem.lot.state.time)
    rows = np.arange(problem.blocks) // axes if len(columns) > 1 else np.zeros(problem.blocks, dtype=np.intp)
    return Candidate(columns[:, :, None, :], shared=False, rows=rows)


def _by_axis(problem: Problem, values: Array) -> Candidate:
    """One column per axis, (units, n, 3), as a candidate."""
    if problem.lot.radial:
        return _by_block(problem, values)
    column = np.swapaxes(of_axes(values, problem.axes, -1), -1, -2).reshape(problem.blocks, problem.n, 1)
    return Candidate(column[:, :, None, :], shared=False)


_OF_POSE = frozenset({"pose", "approach", "outer_deg", "inner_deg"})
"""Drivers that describe the pose, or how it was reached."""


def misfits(
    problem: Problem, drivers: list[Driver], space: Space, floor_variance: float, beyond: Space
) -> list[Misfit]:
    """Drivers of the residuals of a space, most significant first.

    Time, or a temperature that drifts by hundredths of a kelvin, is correlated with the sequence of poses: a quantity is judged
    by what it explains beyond the pose.

    Parameters
    ----------
    floor_variance : residual variance of an adequate model, in units of the space
    beyond : space of the same residuals after any dependence on the pose is removed
    """
    excess = max(space.rss - space.dof * floor_variance, 1e-12)
    found: list[Misfit] = []
    for driver in drivers:
        gain = (space if driver.name in _OF_POSE else beyond).gain(driver.candidate)
        drop, rank = float(gain.drop[0]), int(gain.rank[0])
        if rank:
            share = float(np.clip((drop - rank * floor_variance) / excess, 0.0, 1.0))
            axes = _axes(problem, gain.by_block[:, 0], rank, floor_variance)
            found.append(Misfit(driver.name, axes, share, log_p_value(space, drop, rank), rank, drop))
    # two clocks of a run explain the residuals equally well: their order must not depend on rounding errors
    found.sort(key=lambda p: (round(max(p.log_p, _CERTAIN), _DIGITS), -round(p.share, _DIGITS)))
    best: dict[str, Misfit] = {}
    for misfit in found:
        best.setdefault(misfit.driver, misfit)  # the part (bias, axes, transfer curve) that depends on it most
    return list(best.values())


def _axes(problem: Problem, by_block: Array, rank: int, variance: float) -> tuple[str, ...]:
    """Axes with more than a tenth of the part that the driver explains beyond noise."""
    if problem.lot.radial:
        return ("norm",)
    by_axis = by_block.reshape(-1, problem.per_unit).sum(axis=0) - rank / problem.per_unit * variance
    total = max(float(np.sum(np.maximum(by_axis, 0.0))), 1e-300)
    return tuple(a for a, v in zip((AXES[axis] for axis in problem.axes), by_axis, strict=True) if v > 0.1 * total)
