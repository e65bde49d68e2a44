"""Adequacy of a model for the noise of the data: the largest of many test statistics against its own distribution."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.random import Generator

from inertial.criticism.drivers import Driver
from inertial.criticism.field import Candidates
from inertial.criticism.noise_draws import NoiseDraws
from inertial.decisions import CERTAIN_BELOW, DRAWS, ENOUGH
from inertial.estimation.candidate import Candidate
from inertial.estimation.covariance import LARGE
from inertial.estimation.likelihood import common_fit, known_together, scatter_of_poses, several, shared_noise, together
from inertial.estimation.model import Model
from inertial.estimation.penalty import log_p_value
from inertial.estimation.space import Space
from inertial.probability import log_f_tail

_BATCH = 33
_NUMBERS = 4_000_000
"""Largest number of random numbers per batch: large lots get fewer draws."""


def adequacy(field: Candidates, drivers: list[Driver], model: Model, rng: Generator) -> float:
    """Log probability that an adequate model has a test statistic as extreme in any of all tests.

    The smallest p-value is compared with the smallest p-values of simulated noise (drawn from the fitted covariance, or from the
    model's residuals where their tails are heavy), with the noise of each draw estimated again. A p-value too small for the
    number of draws is multiplied by the number of tests instead (Bonferroni).
    """
    worst, looks = _worst_look(field, drivers, model)
    draws = NoiseDraws(model, rng)
    charged = worst + np.log(max(looks, 1))
    certain = CERTAIN_BELOW**2 if draws.heavy else CERTAIN_BELOW
    if charged < np.log(certain):
        return float(charged)
    return _against_draws(draws, lambda: _all_tests(field, drivers), worst)


def _worst_look(field: Candidates, drivers: list[Driver], model: Model) -> tuple[float, int]:
    """Natural logarithm of the smallest p-value of all tests of a model's residuals, and the number of tests."""
    space = model.space
    together_too = several(model)
    of_poses = max(shared_noise(model), scatter_of_poses(model))
    worst, looks = 0.0, 0
    for candidate in _all_tests(field, drivers):
        gain = space.gain(candidate)
        # of the coefficients of all units, and of those that they share
        looks += gain.drop.size * (1 if candidate.shared or not together_too else 2)
        for point, (drop, of_all) in enumerate(zip(gain.drop.tolist(), gain.common.tolist(), strict=True)):
            rank, of_mean = int(gain.rank[point]), int(gain.common_rank[point])
            if candidate.shared or not together_too:
                log_p = log_p_value(space, drop / (of_poses if candidate.shared else 1.0), rank)
            elif (log_p := _smaller(space, drop, rank, of_all, of_mean)) < worst:
                # φ beside the candidate: an effect common to all units must not count as shared noise
                beside = together(space, space.residual - common_fit(space, candidate, point), errors=0.0)
                log_p = _smaller(space, drop - of_all + of_all / beside, rank, of_all / beside, of_mean)
            worst = min(worst, log_p)
    return worst, looks


def _smaller(space: Space, drop: float, rank: int, common: float, of_mean: int) -> float:
    """The smaller log p-value: of the coefficients of all units, or of those that they share."""
    of_common = float(log_f_tail(common / max(of_mean, 1), of_mean, known_together(space))) if of_mean else 0.0
    return min(log_p_value(space, drop, rank), of_common)


def _against_draws(draws: NoiseDraws, looks: Callable[[], Iterable[Candidate]], worst: float) -> float:
    """Log share of noise draws with a p-value as small as ``worst`` in any test; drawing ends when the result is clear."""
    blocks, n = draws.model.problem.blocks, draws.model.problem.n
    batch = int(np.clip(_NUMBERS // (blocks * n), 5, _BATCH))
    large = blocks * n > LARGE
    if large:
        draws.model.forget()  # the draws need the memory
    drawn, beyond = 0, 0
    while drawn < DRAWS and beyond < ENOUGH:
        # if the first batch is undecided, the next two usually decide: they run together, so that columns are made once
        batches = 1 if large or not drawn else min(2, -(-(DRAWS - drawn) // batch))
        for used, log_p in enumerate(draws.worst(looks(), batch, batches), 1):
            drawn, beyond = drawn + log_p.size, beyond + int(np.count_nonzero(log_p <= worst))
            if beyond >= ENOUGH:
                draws.keep(used)
                break
    return float(np.log((1.0 + beyond) / (1.0 + drawn)))


def _all_tests(field: Candidates, drivers: list[Driver]) -> Iterator[Candidate]:
    yield from field.pieces()
    yield from (d.candidate for d in drivers)
