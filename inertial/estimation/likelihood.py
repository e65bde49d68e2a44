"""Likelihood ratio of a term beside a model, with the noise estimated again with the term included.

Before a term is in the model, part of it counts as noise, above all slow terms as random walk. So the covariance of the richer
model is its own: D = −2[ℓ(V0; H) − ℓ(V1; H, C)], error contrasts of the model's columns H in both, the coefficients of C at
their best, V1 the better of the model's and the richer one's noise.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import NORMAL_MEDIAN, Array
from inertial.decisions import TOGETHER, UNITS_TOGETHER
from inertial.design import of_axes
from inertial.estimation.alternative import Handling, by_block, pose_errors
from inertial.estimation.bases import unit_columns
from inertial.estimation.comparison import estimate, residuals
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise, deviance_of
from inertial.estimation.penalty import freedom, price
from inertial.estimation.space import Space
from inertial.estimation.term import Term
from inertial.probability import log_chi2_tail

_FEWEST_POSES = 10
_QUANTILES = (0.5, 0.75, 0.9)
"""Of the poses, at which their scatter is compared with that of the noise: a table may be off in a part of its poses only."""


@dataclass(frozen=True)
class Ratio:
    """A term beside a model.

    deviance : D, corrected for the noise that units share; rank : coefficients that the plan determines
    price : of them, and of the locations searched; log_p : of the chi-square, one look
    shared : φ with the term inside, by which the part common to all units is divided; again : the ratio with another φ
    """

    deviance: float
    rank: int
    price: float
    log_p: float
    shared: float = 1.0
    again: Callable[[float], "Ratio"] | None = None

    def at(self, shared: float) -> "Ratio":
        """The ratio at another φ: rivals are compared at a common φ, because the estimate of each scatters."""
        return self if self.again is None else self.again(shared)

    @property
    def score(self) -> float:
        """The deviance less its price."""
        return self.deviance - self.price


def likelihood_ratio(model: Model, term: Term, locations: int = 1) -> Ratio:
    """The likelihood ratio of a term beside a model.

    Parameters
    ----------
    locations : number of locations searched, for handling errors
    """
    richer = model.with_term(term)
    noises = [model.noise, richer.noise]
    spaces = [(model.at(noise), richer.at(noise)) for noise in noises]
    full = [_deviance(space, more) for space, more in spaces]
    best = int(np.argmin(full))
    space, more = spaces[best]
    # the unknown state of a memory before the first dwell has coefficients, too
    rank = more.local_rank + more.shared_rank - space.local_rank - space.shared_rank
    if rank <= 0 or not space.gain(term.candidate(model.problem)).rank[0]:
        return Ratio(0.0, 0, 0.0, 0.0)
    plain = _deviance(model.space, model.space)
    dof = max(space.dof, 1)
    deviance = max(plain - full[best], 0.0) * max(dof - rank, 0) / dof
    along, nonlinear = along_mean(model, noises[best], term), freedom(term)
    scatter = scatter_of_poses(richer) if of_station(term) else 1.0

    def divided(shared: float) -> Ratio:
        by = max(shared, scatter)
        ratio = weighed(deviance * (1.0 - along * (1.0 - 1.0 / by)), rank, nonlinear, locations)
        return replace(ratio, shared=shared, again=divided)

    # by what the units share with the term inside: an effect common to all units is not noise
    return divided(shared_noise(richer))


def weighed(deviance: float, rank: int, nonlinear: int, locations: int = 1) -> Ratio:
    """A deviance with its price and its probability."""
    coefficients = rank + nonlinear
    paid = price(deviance, coefficients) + 2.0 * float(np.log(max(locations, 1)))
    return Ratio(deviance, rank, paid, float(log_chi2_tail(deviance, coefficients)))


def _deviance(contrasts: Space, left: Space) -> float:
    """−2 log likelihood of the error contrasts of one model, with what another leaves."""
    return left.logdet + contrasts.information + deviance_of(left.squares, contrasts.by_block)


def shared_noise(model: Model) -> float:
    """φ: variance, over that of independent units, of the mean residual over the units; one for a single unit.

    From the median: one wrong pose does not raise it.
    """
    lot = model.problem.lot
    units = lot.state.time.shape[0]
    if units < 2 or lot.radial:
        return 1.0
    space = model.space
    there = model.problem.covariance.there.reshape(units, model.problem.per_unit, -1)
    left = space.residual.reshape(units, model.problem.per_unit, -1)
    count = there.sum(axis=0)
    mean = np.where(count > 1, left.sum(axis=0) / np.sqrt(np.maximum(count, 1)), np.nan)
    squares = mean[np.isfinite(mean)] ** 2
    if squares.size < 10:
        return 1.0
    lost = space.dof / max(int(model.problem.covariance.count.sum()), 1)
    phi = float(np.median(squares)) / NORMAL_MEDIAN**2 / max(lost, 0.1)
    return phi if phi > 1.0 + TOGETHER * 2.33 / np.sqrt(squares.size) else 1.0


def of_station(term: Term) -> bool:
    """Whether the coefficients of a term are those of the whole lot: of the station, or of what handling did to all units."""
    return term.shared and "unit" not in term.keywords


def scatter_of_poses(model: Model) -> float:
    """Variance of the directions of the poses, as all units see it, over that of the units' own noise; one at least.

    Of each dwell by itself the two errors of its direction that all units share are fitted. Where a table comes to rest within
    some microradians, their chi-square is larger than the noise of the units makes it, in many dwells; the quantiles over the
    dwells are not raised by one wrong pose. What is said of the station has to stand out of this scatter.
    """
    lot = model.problem.lot
    units, n = lot.state.time.shape
    change = pose_errors(lot.state)
    if units < 2 or lot.radial or not change.shape[-1]:
        return 1.0
    there = np.flatnonzero(lot.measured)
    columns = by_block(of_axes(np.broadcast_to(change, (units, n, 3, change.shape[-1])), lot.state.axes, 2))
    gain = model.space.gain_of_dwells(columns, there)
    drop = gain.drop[gain.rank == 2]
    if drop.size < _FEWEST_POSES:
        return 1.0
    largest = 1.0
    for quantile in _QUANTILES:
        expected = -2.0 * np.log1p(-quantile)
        ratio = float(np.quantile(drop, quantile)) / expected
        # standard error of a quantile of exponential values, over the quantile
        error = 2.0 * np.sqrt(quantile / (1.0 - quantile) / drop.size) / expected
        largest = max(largest, ratio if ratio > 1.0 + TOGETHER * error else 1.0)
    return float(largest)


def along_mean(model: Model, noise: Noise, term: Term) -> float:
    """Share of the reduction by a term that is equal in all units, 0 … 1."""
    lot = model.problem.lot
    units = lot.state.time.shape[0]
    if units < 2 or lot.radial:
        return 0.0
    if isinstance(term.effect, Handling) and "unit" in term.keywords:
        return 1.0 / units
    if term.shared:
        return 1.0
    space = model.at(noise)
    columns = space.project(space.whiten(term.candidate(model.problem).of_blocks[:, :, 0, :]))
    unit = unit_columns(columns)[0]
    inverse = np.linalg.pinv(np.swapaxes(unit, -1, -2) @ unit, rcond=1e-4, hermitian=True)
    fitted = (unit @ (inverse @ (np.swapaxes(unit, -1, -2) @ space.residual[..., None])))[..., 0]
    fitted = fitted.reshape(units, model.problem.per_unit, -1)
    total = float(np.sum(fitted**2))
    return float(units * np.sum(fitted.mean(axis=0) ** 2) / total) if total > 0.0 else 0.0


def shared_factor(model: Model, term: Term) -> float:
    """Factor, 1 at least, by which common noise widens the scatter of the separation of a term from its rivals.

    One for an effect with different signs from unit to unit, up to the number of units for one that is equal in all.

    Parameters
    ----------
    model : with the term in it; its residual is the noise
    """
    problem = model.problem
    units = problem.lot.state.time.shape[0]
    if units < 2 or problem.lot.radial:
        return 1.0
    together = correlation_of_units(model)
    return 1.0 + (units - 1) * together * (1.0 if term.shared else _alike(model, term, units))


def correlation_of_units(model: Model) -> float:
    """Correlation of the residuals between units, on the same axis; zero if within chance, and for a single unit."""
    problem = model.problem
    units = problem.lot.state.time.shape[0]
    if units < 2 or problem.lot.radial:
        return 0.0
    left = np.nan_to_num(residuals(problem, model.terms, np.ones(problem.n, dtype=bool)) / problem.error)
    correlation = _pairwise(left.reshape(units, -1))
    chance = 1.0 / np.sqrt(left.size / units * units * (units - 1) / 2.0)
    return correlation if correlation > UNITS_TOGETHER * chance else 0.0


def _alike(model: Model, term: Term, units: int) -> float:
    """Part of a term that is equal in every unit, 0 … 1."""
    for other, columns in model.slices(shared=False):
        if other.effect.id == term.effect.id:
            series = np.einsum("bnp,bp->bn", other.columns(model.problem), estimate(model).local[:, columns])
            series = (series - series.mean(axis=1, keepdims=True)) / model.problem.error
            return max(_pairwise(series.reshape(units, -1)), 0.0)
    return 1.0


def _pairwise(series: Array) -> float:
    """Mean correlation between the rows (units, m), by their common size."""
    units = len(series)
    total = float(np.sum(series**2))
    return 0.0 if total <= 0.0 else (float(np.sum(series.sum(axis=0) ** 2)) / total - 1.0) / (units - 1)
