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
from inertial.estimation.likelihood import mean_share, scatter_of_poses, shared_noise
from inertial.estimation.model import Model
from inertial.estimation.penalty import log_p_value

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
    common = shared_noise(model)
    of_poses = max(common, scatter_of_poses(model))
    worst, looks = 0.0, 0
    for candidate in _all_tests(field, drivers):
        gain = space.gain(candidate)
        looks += gain.drop.size
        for point, (drop, rank) in enumerate(zip(gain.drop.tolist(), gain.rank.tolist(), strict=True)):
            log_p = log_p_value(space, drop, rank)
            together = of_poses if candidate.shared else common
            if log_p < worst and together > 1.0:
                along = 1.0 if candidate.shared else mean_share(space, candidate, point, model.problem.per_unit)
                log_p = log_p_value(space, drop * (1.0 - along * (1.0 - 1.0 / together)), rank)
            worst = min(worst, log_p)
    return worst, looks


def _against_draws(draws: NoiseDraws, looks: Callable[[], Iterable[Candidate]], worst: float) -> float:
    """Log share of noise draws with a p-value as small as ``worst`` in any test; drawing ends when the result is clear."""
    blocks, n = draws.model.problem.blocks, draws.model.problem.n
    batch = int(np.clip(_NUMBERS // (blocks * n), 5, _BATCH))
    if blocks * n > LARGE:
        draws.model.forget()  # the draws need the memory
    drawn, beyond = 0, 0
    while drawn < DRAWS and beyond < ENOUGH:
        # if the first batch is undecided, the next two usually decide: they run together, so that columns are made once
        batches = 1 if not drawn else min(2, -(-(DRAWS - drawn) // batch))
        for used, log_p in enumerate(draws.worst(looks(), batch, batches), 1):
            drawn, beyond = drawn + log_p.size, beyond + int(np.count_nonzero(log_p <= worst))
            if beyond >= ENOUGH:
                draws.keep(used)
                break
    return float(np.log((1.0 + beyond) / (1.0 + drawn)))


def _all_tests(field: Candidates, drivers: list[Driver]) -> Iterator[Candidate]:
    yield from field.pieces()
    yield from (d.candidate for d in drivers)
