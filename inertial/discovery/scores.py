"""Score statistics that a lot contributes to an archive: score and information of every effect outside its model.

With V the covariance of the noise, H the columns of the model and P = V⁻¹ − V⁻¹H(HᵀV⁻¹H)⁻¹HᵀV⁻¹, a column x of a unit and
axis has the score U = xᵀPy and the information I = xᵀPx: U/I estimates its coefficient, with variance 1/I. Both add over units
and lots. The errors of the station on that day are nuisance parameters: their coefficients are estimated from the lot and
eliminated from the scores (as score statistics in meta-analysis, and local parameters in the alignment of detectors).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from inertial import effects as catalogue
from inertial.arrays import Array, Places, over
from inertial.criticism.drivers import forces_along
from inertial.design import starting_values
from inertial.discovery.pose_shape import COUNT, SHAPE, harmonics
from inertial.effects.base import AnyEffect
from inertial.errors import MissingInput
from inertial.estimation.bases import SEEN
from inertial.estimation.model import Model, refuse_without_freedom
from inertial.estimation.noise_shares import Shares
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.term import with_turn_on

Column = tuple[str, int]
"""An effect, and the index of one of its columns."""

LEAST_LEFT = 0.05
"""Smallest share of an effect's information left after elimination of station errors; below it no lot can separate the two."""

TEMPCO = "bias_temperature"
"""The effect whose coefficient multiplies an error of the thermometer."""

_COLLINEAR = 1e-9  # share of its information below which a combination of columns of the station is left out


@dataclass(frozen=True)
class Products:
    """Products of columns of coefficients in g per unit of the effect's column, as means over lots.

    columns : (k,), effect and index of its column, of the sensor; station : (q,), the same of the station
    lot : (h, h), for the h = axes·k sums over the units, errors of the station eliminated, which couples the axes
    inside : (axes, k, k), of a unit before the elimination
    size : (h,), g, rms over the dwells of a column beyond the model, coefficient one · lots : number of lots
    """

    columns: tuple[Column, ...]
    station: tuple[Column, ...]
    lot: Array
    inside: Array
    size: Array
    lots: int = 1

    @classmethod
    def mean(cls, parts: "Sequence[Products]") -> "Products":
        """Means over all lots of the parts, of the columns of any; sizes over the lots that have the column."""
        columns = tuple(dict.fromkeys(column for part in parts for column in part.columns))
        station = tuple(dict.fromkeys(column for part in parts for column in part.station))
        m, k, lots = (
            max((len(part.inside) for part in parts), default=0),
            len(columns),
            sum(part.lots for part in parts),
        )
        lot, inside, size, weight = np.zeros((m, k, m, k)), np.zeros((m, k, k)), np.zeros((m, k)), np.zeros(k)
        for part in parts:
            at = indices(columns, part.columns)
            lot[np.ix_(np.arange(m), at, np.arange(m), at)] += part.lots * part.lot.reshape(m, at.size, m, at.size)
            inside[:, at[:, None], at] += part.lots * part.inside
            size[:, at] += part.lots * part.size.reshape(m, -1)
            weight[at] += part.lots
        lot, inside = lot.reshape(m * k, m * k) / max(lots, 1), inside / max(lots, 1)
        return cls(columns, station, lot, inside, (size / weight).reshape(-1), lots)


@dataclass(frozen=True)
class LotScores:
    """Scores of a lot, in the order of the h hypotheses: axes × columns.

    products : of the columns in this lot, or means over similar lots
    score : (units, h), errors of the station eliminated · own : (units, h), information before the elimination
    information : (h,), of the sums over the units, errors of the station eliminated
    of_station : (2, q), score and information of each column of the station alone
    tempco : (units, axes), g/K, temperature coefficients of the biases in the model; nan without
    floor : g, rms of the noise of a dwell
    """

    products: Products
    score: Array
    own: Array
    information: Array
    of_station: Array
    tempco: Array
    floor: float


def indices(columns: Sequence[Column], some: Sequence[Column]) -> Places:
    """Index of each of some columns among all."""
    index = {column: at for at, column in enumerate(columns)}
    return np.array([index[column] for column in some], dtype=np.intp)


def correlations_of(products: Array) -> Array:
    """Products (..., k, k) normalised to a unit diagonal; zero where the diagonal is zero."""
    root = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 0.0))
    return over(products, root[..., :, None] * root[..., None, :])


def inverse_of(information: Array, least: float) -> Array:
    """Pseudo-inverse of an information (q, q), scaled to a unit diagonal: combinations below the share ``least`` are left out."""
    root = np.sqrt(np.maximum(np.diagonal(information), 0.0))
    inner = np.linalg.pinv(correlations_of(information), rcond=least, hermitian=True)
    return over(np.asarray(inner, dtype=np.float64), np.outer(root, root))


def scores_of(
    lot: Lot, effects: Sequence[str], tried: Iterable[AnyEffect] | None = None, shares: Shares | None = None
) -> LotScores:
    """Scores of the effects outside a model.

    Parameters
    ----------
    lot : dwells in g, of units without data faults
    effects : ids of the model
    tried : effects to score; by default all of the catalogue, and free functions of pose
    shares : shares of 1/f and random walk in the noise, where known; estimating them takes a third of the time

    Raises
    ------
    InertialError
        The lot cannot determine the model.
    """
    problem = Problem(lot)
    terms = with_turn_on(lot.state, terms_of(catalogue.get_all(effects), problem))
    model = Model(problem, terms)
    if shares is not None:
        model = Model(problem, terms, known=[model.noise_at(shares)])
    refuse_without_freedom(model)
    known = set(effects)
    all_tried = [e for e in (catalogue.built_in().values() if tried is None else tried) if e.id not in known]
    local, names = _columns(problem, [e for e in all_tried if e.scope == "sensor"])
    if tried is None:
        local.append(np.repeat(harmonics(np.moveaxis(forces_along(problem), 1, -1)), problem.per_unit, axis=0))
        names += [(SHAPE, k) for k in range(COUNT)]
    shared, station = _columns(problem, [e for e in all_tried if e.scope == "station"])
    return _scored(model, [*local, *shared], tuple(names), tuple(station))


def _columns(problem: Problem, effects: Sequence[AnyEffect]) -> tuple[list[Array], list[Column]]:
    """Columns, (blocks, n, p) each, of effects at the middle of their grids, and their names; without unrecorded quantities."""
    made: list[Array] = []
    names: list[Column] = []
    for effect in effects:
        try:
            of_effect = problem.columns(effect, starting_values([effect], problem.lot.state).get(effect.id, {}))
        except MissingInput:
            continue
        of_effect = of_effect[..., : effect.primary]
        if of_effect.shape[-1] and np.isfinite(of_effect).all():
            made.append(of_effect)
            names += [(effect.id, column) for column in range(of_effect.shape[-1])]
    return made, names


def _scored(
    model: Model,
    columns: Sequence[Array],
    names: tuple[Column, ...],
    station: tuple[Column, ...],
) -> LotScores:
    """Scores of all columns, those of the sensor before those of the station, whitened in one pass."""
    problem, space, even, covariance = model.problem, model.space, model.even, model.problem.covariance
    k, m, every = len(names), problem.per_unit, slice(0, problem.blocks)
    units = problem.blocks // m
    rows, at = np.empty((problem.blocks, k + len(station), problem.n)), 0
    for part in columns:
        rows[:, at : at + part.shape[-1]] = np.swapaxes(part, -1, -2)
        at += part.shape[-1]
    # with equal weights: wander reduces the information of a column, but not its size in the output
    plain = covariance.white_rows(rows[:, :k].copy(), even.noise.shares, every)
    squares = np.einsum("bkn,bkn->bk", plain, plain) - np.sum((plain @ even.q) ** 2, axis=-1)
    plain = squares / (covariance.level * even.noise.scale)[:, None] ** 2
    rows = covariance.white_rows(rows, space.noise.shares, every)
    rows /= (covariance.level * space.noise.scale)[:, None, None]
    squares_before, score = np.einsum("bkn,bkn->bk", rows, rows), (rows @ space.targets[..., :1])[..., 0]
    rows -= (rows @ space.q) @ np.swapaxes(space.q, -1, -2)
    visible = np.einsum("bkn,bkn->bk", rows, rows) > SEEN**2 * squares_before
    rows *= visible[..., None]
    score = score * visible
    of_sensor, of_station = rows[:, :k], rows[:, k:]
    information = np.einsum("bkn,bkn->bk", of_sensor, of_sensor)
    cross = of_sensor @ np.swapaxes(of_station, -1, -2)
    station_score = score[:, k:].sum(axis=0)
    between = np.tensordot(of_station, of_station, ((0, 2), (0, 2)))
    inverse = inverse_of(between, _COLLINEAR)
    free = score[:, :k] - cross @ (inverse @ station_score)
    summed = cross.reshape(units, m, k, len(station)).sum(axis=0)  # (m, k, q), over the units
    lots = np.stack([np.tensordot(of_sensor[a::m], of_sensor[a::m], ((0, 2), (0, 2))) for a in range(m)])
    joined = summed.reshape(m * k, -1)
    less = block_diag(*lots) - joined @ inverse @ joined.T
    separable = np.diagonal(less).reshape(m, k) > LEAST_LEFT * np.diagonal(lots, axis1=1, axis2=2)
    less = less * np.outer(separable, separable)
    rms = np.sqrt(np.maximum(plain, 0.0) * visible[:, :k] * covariance.white / problem.n)
    return LotScores(
        products=Products(names, station, less, lots / units, rms.reshape(units, -1).mean(axis=0)),
        score=(free.reshape(units, m, k) * separable).reshape(units, -1),
        own=information.reshape(units, -1),
        information=np.diagonal(less).copy(),
        of_station=np.stack([station_score, np.diagonal(between)]),
        tempco=_tempco(model).reshape(units, m),
        floor=model.floor(),
    )


def _tempco(model: Model) -> Array:
    """Temperature coefficient of the bias of each block, (blocks,), g/K; nan where the model has none."""
    problem, space = model.problem, model.space
    column = next((at.start for term, at in model.slices(shared=False) if term.effect.id == TEMPCO), None)
    if column is None:
        return np.full(problem.blocks, np.nan)
    shared = model.shared @ space.shared_sizes if model.shared.shape[-1] else np.zeros_like(problem.y)
    white = space.whiten(np.concatenate([model.local, (problem.y - shared)[..., None]], axis=-1))
    return np.array([np.linalg.lstsq(block[:, :-1], block[:, -1], rcond=None)[0][column] for block in white])
