"""Likelihood ratio of a term added to a model, with the noise estimated again with the term included.

While a term is missing, part of it counts as noise; a slow term mostly as random walk. The richer model therefore has a
covariance estimated for it: D = −2[ℓ(V0; H) − ℓ(V1; H, C)], with error contrasts of the model's columns H in both likelihoods,
the coefficients of the term's columns C at their maximum, and V1 the better of the noises of the model and of the richer model.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import gamma

import numpy as np

from inertial.arrays import Array
from inertial.decisions import TOGETHER, UNITS_TOGETHER
from inertial.design import of_axes
from inertial.distributions import chi2_quantile
from inertial.estimation.alternative import Handling, by_block, pose_errors
from inertial.estimation.bases import SEEN, unit_columns
from inertial.estimation.candidate import Candidate
from inertial.estimation.comparison import estimate, residuals
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise, Shares, deviance_of
from inertial.estimation.penalty import freedom, price
from inertial.estimation.problem import Problem
from inertial.estimation.space import Gain, Space
from inertial.estimation.term import Term
from inertial.probability import log_chi2_tail, log_f_tail

_FEWEST_POSES = 10
_QUANTILES = (0.5, 0.75, 0.9)
"""Quantiles over the poses at which their scatter is compared with noise: a table may be inaccurate in some poses only."""


@dataclass(frozen=True)
class Ratio:
    """The likelihood ratio of a term added to a model.

    deviance : D, corrected for the noise that units share; rank : number of coefficients that the plan determines
    price : penalty for these coefficients and for the locations searched; log_p : log probability of D under noise, one test
    shared : φ of the model with the term, which divides the part of D common to all units
    shares : shares of wander at which D is largest; again : the ratio at another φ, with further shares as well
    """

    deviance: float
    rank: int
    price: float
    log_p: float
    shared: float = 1.0
    shares: Shares = field(default_factory=Shares)
    again: Callable[[float, Shares], "Ratio"] | None = None

    def at(self, shared: float, shares: Shares) -> "Ratio":
        """The ratio at another φ, and at given shares if D is larger there.

        Rivals are compared at a common φ, because each estimate of φ scatters, and at the same shares: where few soaks leave the
        slow noise open, D differs by more between two estimates of it than between two effects.
        """
        return self if self.again is None else self.again(shared, shares)

    @property
    def score(self) -> float:
        """The deviance less its price."""
        return self.deviance - self.price


def likelihood_ratio(model: Model, term: Term, locations: int = 1) -> Ratio:
    """The likelihood ratio of a term added to a model.

    Parameters
    ----------
    locations : number of locations searched, for handling errors
    """
    richer = model.with_term(term)
    return _ratio(model, term, locations, [model.noise, richer.noise])


def _ratio(model: Model, term: Term, locations: int, noises: Sequence[Noise], shared: float | None = None) -> Ratio:
    """The likelihood ratio at the best of some noises, and at a given φ or that of the model with the term."""
    richer = model.with_term(term)
    spaces = [(model.at(noise), richer.at(noise)) for noise in noises]
    full = [restricted_deviance(space, more) for space, more in spaces]
    best = int(np.argmin(full))
    space, more = spaces[best]
    # includes the coefficients of the unknown state of a memory before the first dwell
    rank = more.local_rank + more.shared_rank - space.local_rank - space.shared_rank
    gain = space.gain(term.candidate(model.problem))
    if rank <= 0 or not gain.rank[0]:
        return Ratio(0.0, 0, 0.0, 0.0)
    plain = restricted_deviance(model.space, model.space)
    dof = max(space.dof, 1)
    deviance = max(plain - full[best], 0.0) * max(dof - rank, 0) / dof
    common, nonlinear = common_part(space, term, model.problem, gain, space.rss - more.rss), freedom(term)
    scatter = scatter_beside(richer, term)
    shares = noises[best].shares

    def again(shared: float, others: Shares) -> Ratio:
        if others in [noise.shares for noise in noises]:
            ratio = weighed(deviance, rank, nonlinear, locations, replace(common, noise=max(shared, scatter)))
            return replace(ratio, shared=shared, shares=shares, again=again)
        # made anew: the ratios of a contest would keep the columns of every rival in memory
        return _ratio(model, term, locations, [*noises, model.with_term(term).noise_at(others)], shared)

    # φ with the term in the model: an effect common to all units must not count as shared noise
    return again(shared_noise(richer) if shared is None else shared, shares)


@dataclass(frozen=True)
class Common:
    """What of a reduction of the deviance is common to all units.

    share : 0 … 1, common part of the reduction by coefficients of the lot
    drop, own : reductions of chi-square by coefficients by axis that all units share, and by what is of each unit
    rank : number of the coefficients that all units share; units : number of units with coefficients of their own, 1 if none
    noise : φ, which divides the common part; known : degrees of freedom of φ
    """

    share: float = 0.0
    drop: float = 0.0
    own: float = 0.0
    rank: int = 0
    units: int = 1
    noise: float = 1.0
    known: float = 1.0

    def parted(self, deviance: float, rank: int) -> tuple[float, float]:
        """The common part of a deviance with ``rank`` coefficients, not divided by φ, and the part of each unit.

        By chance every coefficient reduces the deviance by one; what is beyond that is divided as the sum of squares is, which
        falls by more, because the noise of the smaller model includes part of the effect.
        """
        chance = min(self.drop, self.rank), min(self.own, rank - self.rank)
        beyond = self.drop - chance[0], self.own - chance[1]
        if deviance <= sum(chance) or sum(beyond) <= 0.0:
            mean = deviance * chance[0] / max(sum(chance), 1e-300)
        else:
            mean = chance[0] + (deviance - sum(chance)) * beyond[0] / sum(beyond)
        return mean, deviance - mean


def weighed(deviance: float, rank: int, nonlinear: int, locations: int = 1, common: Common = Common()) -> Ratio:
    """The ratio of a deviance with its price and its probability.

    Coefficients of units are their mean and the deviations from it, and each of the two has its own price: an effect that all
    sensors of a design have needs evidence for a few coefficients, whatever the number of units.

    Parameters
    ----------
    nonlinear : number of nonlinear parameters; locations : number of locations searched
    """
    coefficients, of_locations = rank + nonlinear, 2.0 * float(np.log(max(locations, 1)))
    if common.units == 1 or not 0 < common.rank < rank:
        deviance *= 1.0 - common.share * (1.0 - 1.0 / common.noise)
        paid = price(deviance, coefficients) + of_locations
        return Ratio(deviance, rank, paid, float(log_chi2_tail(deviance, coefficients)))
    mean, own = common.parted(deviance, rank)
    mean, of_mean = mean / common.noise, common.rank + nonlinear
    paid = price(mean, of_mean) + price(own, rank - common.rank) + of_locations
    log_p = min(log_chi2_tail(mean + own, coefficients), log_f_tail(mean / of_mean, of_mean, common.known))
    return Ratio(mean + own, rank, paid, float(min(log_p + np.log(2.0), 0.0)))


def restricted_deviance(contrasts: Space, left: Space) -> float:
    """−2 log likelihood: error contrasts of the model of ``contrasts``, residual sums of squares of the model of ``left``."""
    return left.logdet + contrasts.information + deviance_of(left.squares, contrasts.by_block)


def shared_noise(model: Model) -> float:
    """φ: variance of the mean residual over the units, over its value for independent units; 1 for a single unit."""
    return together(model.space, model.space.residual) if several(model) else 1.0


def several(model: Model) -> bool:
    """Whether a lot has several units in known poses."""
    return model.problem.lot.state.time.shape[0] > 1 and not model.problem.lot.radial


def together(space: Space, residual: Array, errors: float = TOGETHER) -> float:
    """φ of whitened residuals (blocks, n) of several units, by the largest of some quantiles of the squares of their mean.

    One wrong pose does not raise quantiles; pose errors act on some axes in some poses only, which the median does not show.

    Parameters
    ----------
    errors : standard errors by which φ exceeds one; it is one otherwise
    """
    there = space.covariance.there.reshape(-1, space.covariance.axes, residual.shape[1])
    left = residual.reshape(there.shape)
    count = there.sum(axis=0)
    mean = np.where(count > 1, left.sum(axis=0) / np.sqrt(np.maximum(count, 1)), np.nan)
    squares = mean[np.isfinite(mean)] ** 2
    if squares.size < _FEWEST_POSES:
        return 1.0
    lost = max(space.dof / max(int(space.covariance.count.sum()), 1), 0.1)
    return _above_noise(squares / lost, 1, errors)


def _above_noise(values: Array, dof: int, errors: float = TOGETHER) -> float:
    """The largest ratio of quantiles of values to those of chi-square, as far as it exceeds one by some standard errors."""
    quantile = np.array(_QUANTILES)
    expected = chi2_quantile(quantile, dof)
    ratio = np.quantile(values, quantile) / expected
    density = 0.5 * (0.5 * expected) ** (0.5 * dof - 1.0) * np.exp(-0.5 * expected) / gamma(0.5 * dof)
    error = np.sqrt(quantile * (1.0 - quantile) / values.size) / (expected * density)
    return float(np.max(ratio, where=ratio > 1.0 + errors * error, initial=1.0))


def of_station(term: Term) -> bool:
    """Whether a term has coefficients of the whole lot: of the station, or of a handling error of all units."""
    return term.shared and "unit" not in term.keywords


def scatter_of_poses(model: Model) -> float:
    """Variance of the pose directions common to all units, over that expected from the units' noise; at least 1.

    The two direction errors that all units share are fitted to each dwell separately. Where a table comes to rest only within
    some microradians, their chi-square exceeds that of the units' noise in many dwells; quantiles over the dwells are not raised
    by one wrong pose. An effect of the station must exceed this scatter.
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
    return _above_noise(drop, 2)


def common_part(space: Space, term: Term, problem: Problem, gain: Gain, total: float = 0.0) -> Common:
    """The part of the reduction by a term, in the space of a model without it, that is common to all units.

    Parameters
    ----------
    gain : of the term's columns in that space
    total : reduction of the sum of squares by the term with the unknown state before the first dwell, which no units share
    """
    units = problem.lot.state.time.shape[0]
    if units < 2 or problem.lot.radial:
        return Common()
    if isinstance(term.effect, Handling) and "unit" in term.keywords:
        return Common(1.0 / units)
    return Common(1.0) if term.shared else common_at(space, gain, 0, total)


def common_at(space: Space, gain: Gain, point: int, total: float = 0.0) -> Common:
    """The common part of a gain of coefficients of units, at a point of its grid, or of a larger ``total``."""
    common = max(float(gain.common[point]), 0.0)
    total = max(float(gain.drop[point]), total, common)
    # over the noise beside the term, of which that of the model without it may be a multiple
    noise = max(space.rss - total, 1e-12 * space.rss, 1e-300) / max(space.dof - int(gain.rank[point]), 1)
    rank, units = int(gain.common_rank[point]), max(len(gain.by_block) // space.covariance.axes, 1)
    return Common(0.0, common / noise, (total - common) / noise, rank, units, known=known_together(space))


def known_together(space: Space) -> float:
    """Degrees of freedom of φ: quantiles have about 0.4 of the information of the mean square of as many values."""
    return 0.4 * max(space.dof * space.covariance.axes / len(space.q), 5.0)


def scatter_beside(richer: Model, term: Term) -> float:
    """Scatter of the poses that a term of the station must exceed beside it; 1 for any other term."""
    return scatter_of_poses(richer) if of_station(term) else 1.0


def common_fit(space: Space, candidate: Candidate, point: int) -> Array:
    """Whitened series (blocks, n) of a candidate at a point of its grid, with coefficients by axis that all units share."""
    axes = space.covariance.axes
    columns = space.project(space.whiten(candidate.at(point)))
    by_axis = columns.reshape(-1, axes, *columns.shape[1:]).transpose(1, 0, 2, 3).reshape(axes, -1, columns.shape[2])
    left = space.residual.reshape(-1, axes, columns.shape[1]).transpose(1, 0, 2).reshape(axes, -1, 1)
    unit = unit_columns(by_axis)[0]
    across = np.swapaxes(unit, -1, -2)
    fitted = unit @ (np.linalg.pinv(across @ unit, rcond=SEEN**2, hermitian=True) @ (across @ left))
    return fitted.reshape(axes, -1, columns.shape[1]).transpose(1, 0, 2).reshape(columns.shape[:2])


def shared_factor(model: Model, term: Term) -> float:
    """Factor, at least 1, by which noise common to the units raises the variance of a term's separation from its rivals.

    It is 1 for an effect whose sign varies from unit to unit, and at most the number of units, for an effect equal in all.

    Parameters
    ----------
    model : with the term in it; its residual is the noise
    """
    if not several(model):
        return 1.0
    units, together = model.problem.lot.state.time.shape[0], correlation_of_units(model)
    return 1.0 + (units - 1) * together * (1.0 if term.shared else _correlation_of_term(model, term, units))


def correlation_of_units(model: Model) -> float:
    """Correlation of the residuals of different units on the same axis; zero if not significant or for a single unit."""
    if not several(model):
        return 0.0
    problem, units = model.problem, model.problem.lot.state.time.shape[0]
    left = np.nan_to_num(residuals(problem, model.terms, np.ones(problem.n, dtype=bool)) / problem.error)
    correlation = _mean_correlation(left.reshape(units, -1))
    chance = 1.0 / np.sqrt(left.size / units * units * (units - 1) / 2.0)
    return correlation if correlation > UNITS_TOGETHER * chance else 0.0


def _correlation_of_term(model: Model, term: Term, units: int) -> float:
    """Mean correlation, 0 … 1, of a fitted term between the units; 1 where the term has no coefficients by unit."""
    for other, columns in model.slices(shared=False):
        if other.effect.id == term.effect.id:
            series = np.einsum("bnp,bp->bn", other.columns(model.problem), estimate(model).local[:, columns])
            series = (series - series.mean(axis=1, keepdims=True)) / model.problem.error
            return max(_mean_correlation(series.reshape(units, -1)), 0.0)
    return 1.0


def _mean_correlation(series: Array) -> float:
    """Mean correlation between the rows of ``series`` (units, m), normalised by their pooled sum of squares."""
    units = len(series)
    total = float(np.sum(series**2))
    return 0.0 if total <= 0.0 else (float(np.sum(series.sum(axis=0) ** 2)) / total - 1.0) / (units - 1)
