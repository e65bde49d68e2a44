"""How far measurements part rivals: the chi-square that the wrong one must leave, before and after steps not measured yet.

Every rival is taken as the truth once, with its fitted coefficients and nonlinear parameters; every other one, with the rest
of the model, is fitted to what it predicts. What is left, whitened for white noise and wander, is the noncentrality of the
test between the two (Atkinson & Fedorov, Biometrika 62 (1975) 57: T-optimal designs maximise the smallest of these).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.comparison import estimate
from inertial.criticism.covariance import Covariance, Noise
from inertial.criticism.handling.base import Handling
from inertial.criticism.model import Model, Term
from inertial.criticism.problem import Lot, Problem
from inertial.criticism.shared_noise import shared_factor
from inertial.criticism.space import Space
from inertial.criticism.turn_on import with_turn_on
from inertial.effects.base import Nonlinear
from inertial.planning.sequences import SequenceStep, StationPace, extended

Array = NDArray[np.float64]

_STEPS = (0.25, 0.625, 1.6, 4.0)
"""Factors by which the nonlinear parameters of a rival may move when it is fitted to what is measured next."""

_FEW = 3
"""Units that stand for the lot: all go through the same steps."""


@dataclass(frozen=True)
class Rivals:
    """Effects that measurements do not tell apart, as they were fitted.

    lot : a few units of it; weight : units of the whole lot over these
    rest : the terms of the model beside the rivals
    predicted : per rival, its coefficients (blocks, p) or (p,) for a station's effect
    noise : of the few units; variance : what units share of it makes it larger
    covariance : that the noise's shares are counted in
    """

    lot: Lot
    weight: float
    rest: tuple[Term, ...]
    terms: tuple[Term, ...]
    predicted: tuple[Array, ...]
    noise: Noise
    variance: float
    covariance: Covariance

    @property
    def ids(self) -> tuple[str, ...]:
        """Effect ids, the best first."""
        return tuple(t.effect.id for t in self.terms)


def rivals_of(model: Model, terms: Sequence[Term], others: Sequence[Term]) -> Rivals:
    """Rivals with the coefficients that a fit beside the rest of the model gives each of them.

    Parameters
    ----------
    model : with everything that was found, for the noise
    terms : the rivals
    others : the terms of the model beside them
    """
    units = model.problem.lot.state.time.shape[0]
    pick = np.unique(np.linspace(0, units - 1, min(units, _FEW)).round().astype(int)).tolist()
    blocks = pick if model.problem.lot.radial else [3 * u + a for u in pick for a in range(3)]
    others = [
        t for t in others if not isinstance(t.effect, Handling)
    ]  # of single units, and no step to come changes them
    predicted = tuple(_coefficients(Model(model.problem, [t, *others], near=model.noise), t, blocks) for t in terms)
    widened_by = shared_factor(Model(model.problem, [terms[0], *others], near=model.noise), terms[0]) if terms else 1.0
    return Rivals(
        lot=model.problem.lot.units(pick),
        weight=units / len(pick),
        rest=tuple(others),
        terms=tuple(terms),
        predicted=predicted,
        noise=model.noise.pick(blocks),
        variance=model.space.variance * widened_by,
        covariance=model.problem.covariance,
    )


def _coefficients(model: Model, term: Term, blocks: Sequence[int]) -> Array:
    """Coefficients of the first term of a model: of some blocks, or shared."""
    found = estimate(model)
    columns = model.problem.columns(term.effect, term.keywords)[..., : term.first].shape[-1]
    return found.shared[:columns] if term.shared else found.local[list(blocks), :columns]


def separations(rivals: Rivals, steps: Sequence[SequenceStep] = (), pace: StationPace | None = None) -> Array:
    """Chi-square (r, r) that the rival of a column leaves, fitted to what the rival of a row predicts, in the whole lot.

    Parameters
    ----------
    steps : taken after what was measured; none for what the measurements so far part
    """
    problem = widened(rivals, steps, pace) if steps else Problem(rivals.lot)
    targets = predictions(rivals, problem)
    noise = problem.covariance.taken(rivals.noise, rivals.covariance)
    count = len(rivals.terms)
    left = np.zeros((count, count))
    for column, wrong in enumerate(rivals.terms):
        rest = with_turn_on(problem.lot.state, rivals.rest)
        near = [left_of(Model(problem, [*rest, t]), targets, noise) for t in _neighbours(problem, wrong)]
        left[:, column] = np.min(near, axis=0)
    np.fill_diagonal(left, 0.0)
    return left * rivals.weight / rivals.variance


def _neighbours(problem: Problem, term: Term) -> list[Term]:
    """A rival as it was fitted, and with each nonlinear parameter a step to both sides: it will be fitted again.

    A choice that only the next measurement offers (whether ageing goes on without power) will be made as suits it best.
    """
    found = [term]
    for parameter in term.effect.parameters(problem.lot.state):
        if parameter.name not in term.keywords:
            found += [Term(term.effect, (*term.values, (parameter.name, c)), term.first) for c in parameter.choices]
        elif not parameter.choices:
            values = [_moved(term.keywords[parameter.name], factor, parameter) for factor in _STEPS]
            found += [
                Term(term.effect, tuple({**term.keywords, parameter.name: v}.items()), term.first)
                for v in dict.fromkeys(values)
            ]
    return found


def _moved(value: float | tuple[float, ...], factor: float, parameter: Nonlinear) -> float | tuple[float, ...]:
    """A nonlinear parameter, or that of each axis, moved within its bounds."""
    if isinstance(value, tuple):
        return tuple(float(np.clip(v * factor, parameter.low, parameter.high)) for v in value)
    return float(np.clip(value * factor, parameter.low, parameter.high))


def smallest(left: Array) -> Array:
    """Of each pair the smaller of its two directions, (r, r) symmetric: whichever of the two is true."""
    return np.minimum(left, left.T)


def left_of(model: Model, targets: Array, noise: Noise) -> Array:
    """Whitened sums of squares (r,) that a model leaves of some series (blocks, n, r)."""
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
    """What each rival adds to the series of a problem of the same units, (blocks, n, r), g."""
    found: list[Array] = []
    for term, coefficients in zip(rivals.terms, rivals.predicted, strict=True):
        columns = problem.columns(term.effect, term.keywords)[..., : term.first]
        own = np.einsum("bnp,bp->bn", columns, np.broadcast_to(coefficients, (columns.shape[0], columns.shape[-1])))
        found.append(own)
    return np.stack(found, axis=-1)


def widened(rivals: Rivals, steps: Sequence[SequenceStep], pace: StationPace | None) -> Problem:
    """The problem with steps taken after its dwells; readings there are of no account."""
    lot = rivals.lot
    units = lot.state.time.shape[0]
    state = extended(lot.state, steps, pace, response=lot.response)
    scale = 1.0 if pace is None or pace.last_dwell_s <= 0.0 else float(np.sqrt(pace.last_dwell_s / pace.dwell_s))
    typical = scale * np.nanmedian(np.where(np.isfinite(lot.error), lot.error, np.nan), axis=1, keepdims=True)
    typical = np.where(np.isfinite(typical), typical, np.nanmedian(typical))
    error = np.concatenate([lot.error, np.broadcast_to(typical, (units, len(steps), 3))], axis=1)
    output = np.concatenate([lot.output, np.zeros((units, len(steps), 3))], axis=1)
    return Problem(replace(lot, state=state, output=output, error=error))
