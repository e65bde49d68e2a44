"""Short ways of the diagnosis to the numbers of the long ones: to nine digits."""

import numpy as np
import pytest
from scipy import stats

from inertial.criticism.adequacy import _drops
from inertial.criticism.covariance import Covariance
from inertial.criticism.noise_shares import Noise, Shares
from inertial.criticism.space import SEEN, Candidate, Space
from inertial.criticism.tail_areas import log_chi2_tail, log_f_tail
from inertial.noise.flicker import flicker_kernel, summed, time_constants

BLOCKS, N = 6, 40
SHARES = Shares(10.0 ** (4 / 8), 10.0 ** (8 / 8))


def covariance(rng: np.random.Generator) -> Covariance:
    return Covariance(np.tile(np.arange(N) * 30.0, (BLOCKS, 1)), 1e-5 * np.ones((BLOCKS, N)) * rng.uniform(0.95, 1.05))


@pytest.mark.parametrize("distinct", [1, 3])
def test_columns_that_blocks_repeat_are_whitened_once_with_the_same_numbers(
    rng: np.random.Generator, distinct: int
) -> None:
    columns = np.tile(rng.standard_normal((distinct, N, 5)), (BLOCKS // distinct, 1, 1))
    whole, once = (covariance(rng) for _ in range(2))
    np.testing.assert_allclose(
        once.whitened("key", columns, SHARES, distinct=distinct),
        once.level[0] ** -1 * whole.level[0] * whole.whiten(columns, SHARES),
        rtol=1e-9,
        atol=1e-9 * np.abs(columns).max() / once.level[0],
    )


@pytest.mark.parametrize("p", [1, 2, 3])
def test_what_a_candidate_takes_off_draws_is_what_least_squares_takes_off(rng: np.random.Generator, p: int) -> None:
    noise = Noise(SHARES, rng.uniform(0.8, 1.2, BLOCKS))
    local = np.stack([np.ones((BLOCKS, N)), rng.standard_normal((BLOCKS, N))], axis=-1)
    space = Space(covariance(rng), noise, rng.standard_normal((BLOCKS, N)), local, np.zeros((BLOCKS, N, 0)))
    columns = rng.standard_normal((BLOCKS, N, 4, p))
    columns[2, :, 1, 0] = 3.0 * local[2, :, 1]  # the model has it already
    draws = space.project(rng.standard_normal((BLOCKS, N, 7)))
    drops = _drops(Candidate(columns, shared=False), space, draws)
    for g, (drop, rank) in enumerate(drops):
        expected, seen = np.zeros(7), 0
        white = space.whiten(columns[:, :, g])
        left = space.project(white) / np.linalg.norm(white, axis=1)[:, None]
        for b in range(BLOCKS):
            u, s, _ = np.linalg.svd(left[b], full_matrices=False)
            expected += np.sum((u[:, s > SEEN].T @ draws[b]) ** 2, axis=0)
            seen += int(np.sum(s > SEEN))
        assert rank == seen
        np.testing.assert_allclose(drop, expected, rtol=1e-9)


def test_processes_by_squares_are_those_by_exponentials() -> None:
    gap = np.abs(np.subtract.outer(np.arange(200) * 30.0, np.arange(200) * 30.0))
    constants = time_constants(24_000.0, 13)
    by_exponentials = sum(np.exp(-gap / tau) for tau in constants)
    np.testing.assert_allclose(summed(gap, constants), by_exponentials, rtol=1e-10)
    odd = np.array([300.0, 110.0, 7.0])
    np.testing.assert_allclose(summed(gap, odd), sum(np.exp(-gap / tau) for tau in odd), rtol=1e-14)
    assert np.linalg.eigvalsh(flicker_kernel(np.arange(200) * 30.0))[0] > 0.0


def test_tail_areas_are_those_of_the_distributions() -> None:
    ratio = np.array([0.0, 1e-3, 0.7, 1.0, 3.0, 40.0, 1e5])
    for first, second in ((1, 10), (24, 1500), (3, 2)):
        np.testing.assert_allclose(
            log_f_tail(ratio, first, second), stats.f.logsf(ratio, first, second), rtol=1e-12, atol=1e-12
        )
        np.testing.assert_allclose(log_chi2_tail(ratio, first), stats.chi2.logsf(ratio, first), rtol=1e-12, atol=1e-12)
    assert log_f_tail(-1e-12, 2, 5) == 0.0
