"""Separation of rivals by measurements: the chi-square that a wrong rival leaves, before and after planned steps.

Each rival in turn is assumed true, with its fitted coefficients and nonlinear parameters; every other one, with the rest of the
model, is fitted to its prediction. The sum of squares of the residuals, whitened for white noise and wander, is the noncentrality
of the test between the two (Atkinson & Fedorov, Biometrika 62 (1975) 57: T-optimal designs maximise the smallest of these).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inertial.arrays import Array
from inertial.decisions import AXES_DIFFER
from inertial.estimation.alternative import Handling
from inertial.estimation.candidate import blocks_of_units
from inertial.estimation.comparison import estimate
from inertial.estimation.covariance import Covariance
from inertial.estimation.likelihood import shared_factor
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.profile import LikelihoodProfile
from inertial.estimation.space import Space
from inertial.estimation.term import Term, with_turn_on
from inertial.planning.sequences import SequenceStep, StationPace, extended

FEW, MANY = 3, 16
"""Number of units that represent the lot, in which all have the same steps: for the search, and for the expected result."""


@dataclass(frozen=True)
class Rivals:
    """Effects that the present measurements do not separate, with their fits.

    lot : a few units of the lot; weight : number of units of the complete lot over that of these
    rest : the terms of the model beside the rivals; terms : the rivals, best first
    predicted : coefficients of each rival, (blocks, p), or (p,) for an effect of the station
    noise : noise of the few units; variance : whitened residual variance, enlarged for noise that the units share
    covariance : covariance whose white variance and duration are the unit of the noise's shares
    observed : (r, r), chi-square of the present measurements in favour of the rival of a row over that of a column
    """

    lot: Lot
    weight: float
    rest: tuple[Term, ...]
    terms: tuple[Term, ...]
    predicted: tuple[Array, ...]
    noise: Noise
    variance: float
    covariance: Covariance
    observed: Array

    @property
    def ids(self) -> tuple[str, ...]:
        """Effect ids, the best first."""
        return tuple(t.effect.id for t in self.terms)

    @cached_property
    def typical_error(self) -> Array:
        """Median white standard error of the dwells of each unit and axis, (units, 1, 3), g; NaN where it has none."""
        return np.nanmedian(np.where(np.isfinite(self.lot.error), self.lot.error, np.nan), axis=1, keepdims=True)


def rivals_of(model: Model, terms: Sequence[Term], others: Sequence[Term], most: int = FEW) -> Rivals:
    """Rivals with coefficients fitted to each of them beside the rest of the model.

    Parameters
    ----------
    model : model with all identified effects, for the noise
    terms : the rivals
    others : the terms of the model beside them
    most : largest number of units that represent the lot
    """
    units = model.problem.lot.state.time.shape[0]
    pick = np.unique(np.linspace(0, units - 1, min(units, most)).round().astype(int)).tolist()
    blocks = pick if model.problem.lot.radial else blocks_of_units(np.array(pick), model.problem.per_unit).tolist()
    # initial states of memories are free here, even if the search found the run explained without them
    terms, others = ([replace(t, rest=False) for t in each] for each in (terms, others))
    others = [t for t in others if not isinstance(t.effect, Handling)]  # errors of this run do not affect later steps
    fitted = [Model(model.problem, [t, *others], near=model.noise) for t in terms]
    predicted = tuple(_coefficients(m, t, blocks) for m, t in zip(fitted, terms, strict=True))
    squares = np.array([m.at(model.noise).rss for m in fitted])
    widened_by = shared_factor(Model(model.problem, [terms[0], *others], near=model.noise), terms[0]) if terms else 1.0
    variance = model.space.variance * widened_by
    return Rivals(
        lot=model.problem.lot.units(pick),
        weight=units / len(pick),
        rest=tuple(others),
        terms=tuple(terms),
        predicted=predicted,
        noise=model.noise.pick(blocks),
        variance=variance,
        covariance=model.problem.covariance,
        observed=(squares[None, :] - squares[:, None]) / variance,
    )


def _coefficients(model: Model, term: Term, blocks: Sequence[int]) -> Array:
    """Coefficients of the first term of a model: (blocks, p) of some blocks, or (p,) shared ones."""
    fit = estimate(model)
    columns = term.columns(model.problem).shape[-1]
    return fit.shared[:columns] if term.shared else fit.local[list(blocks), :columns]


@dataclass(frozen=True)
class Apart:
    """The separation of rivals.

    left : (r, r), chi-square over the complete lot of the row rival's prediction after a fit of the column rival
    whole : (r,), chi-square of each rival's prediction after a fit of the model without any rival
    """

    left: Array
    whole: Array


def apart(
    rivals: Rivals, steps: Sequence[SequenceStep] = (), pace: StationPace | None = None, *, fine: bool = True
) -> Apart:
    """The separation of rivals, each fitted to the prediction of every other one.

    Parameters
    ----------
    steps : steps measured after the present dwells; none: separation by the present measurements
    fine : whether the wrong rival's nonlinear parameters are fitted between the grid values
    """
    problem = widened(rivals, steps, pace) if steps else Problem(rivals.lot)
    noise = problem.covariance.rescaled(rivals.noise, rivals.covariance)
    rest = Model(problem, with_turn_on(problem.lot.state, rivals.rest))
    to_lot = rivals.weight / rivals.variance
    profile = LikelihoodProfile(rest, predictions(rivals, problem), noise, AXES_DIFFER / to_lot)
    left = np.stack([profile.left(wrong, fine=fine) for wrong in rivals.terms], axis=1)
    np.fill_diagonal(left, 0.0)
    return Apart(left * to_lot, profile.whole * to_lot)


def residual_squares(model: Model, targets: Array, noise: Noise) -> Array:
    """Whitened sums of squares (r,) of the residuals of a model on some series (blocks, n, r)."""
    space: Space = model.at(noise)
    free = space.project(space.whiten(targets))
    blocks, n, count = free.shape
    flat = free.reshape(blocks * n, count)
    if model.shared.shape[-1]:
        shared = space.targets[..., 1:].reshape(blocks * n, -1)
        size = np.linalg.norm(shared, axis=0)
        shared = shared / np.where(size > 0.0, size, 1.0)
        flat = flat - shared @ np.linalg.lstsq(shared, flat, rcond=1e-9)[0]
    return np.sum(flat**2, axis=0)


def predictions(rivals: Rivals, problem: Problem) -> Array:
    """Contribution of each rival to the series of a problem of the same units, (blocks, n, r), g."""
    contributions: list[Array] = []
    for term, coefficients in zip(rivals.terms, rivals.predicted, strict=True):
        columns = term.columns(problem)
        series = np.einsum("bnp,bp->bn", columns, np.broadcast_to(coefficients, (columns.shape[0], columns.shape[-1])))
        contributions.append(series)
    return np.stack(contributions, axis=-1)


def widened(rivals: Rivals, steps: Sequence[SequenceStep], pace: StationPace | None) -> Problem:
    """The problem of the rivals' lot with further steps after its dwells, whose outputs are not used."""
    lot = rivals.lot
    units = lot.state.time.shape[0]
    state = extended(lot.state, steps, pace, response=lot.response)
    scale = 1.0 if pace is None or pace.last_dwell_s <= 0.0 else float(np.sqrt(pace.last_dwell_s / pace.dwell_s))
    typical = scale * rivals.typical_error
    if not np.isfinite(typical).all():
        typical = np.where(np.isfinite(typical), typical, np.nanmedian(typical))
    error = np.concatenate([lot.error, np.broadcast_to(typical, (units, len(steps), lot.output.shape[-1]))], axis=1)
    output = np.concatenate([lot.output, np.zeros((units, len(steps), lot.output.shape[-1]))], axis=1)
    loudness = None if lot.loudness is None else np.concatenate([lot.loudness, np.ones(len(steps))])
    return Problem(replace(lot, state=state, output=output, error=error, loudness=loudness))
