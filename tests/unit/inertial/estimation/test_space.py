"""Short ways of the engine to the numbers of the long ones: to nine digits."""

import numpy as np
import pytest

from inertial.criticism.noise_draws import Directions
from inertial.estimation.bases import SEEN, schur
from inertial.estimation.candidate import Candidate, times_rows
from inertial.estimation.covariance import Covariance
from inertial.estimation.noise_shares import Noise, Shares
from inertial.estimation.space import Space

BLOCKS, N = 6, 40
SHARES = Shares(10.0 ** (4 / 8), 10.0 ** (8 / 8))


def covariance(rng: np.random.Generator) -> Covariance:
    error = 1e-5 * np.ones((BLOCKS, N)) * rng.uniform(0.95, 1.05)
    return Covariance(np.tile(np.arange(N) * 30.0, (BLOCKS, 1)), error, axes=3)


@pytest.mark.parametrize("rows", [[0] * BLOCKS, [0, 1, 2] * 2, [0, 0, 0, 1, 1, 1]])
@pytest.mark.parametrize("shares", [SHARES, Shares()])
def test_columns_that_blocks_share_are_whitened_once_with_the_same_products(rng, rows, shares):
    few, whole = rng.standard_normal((max(rows) + 1, N, 5, 2)), covariance(rng)
    once = whole.products(Candidate(few, shared=False, rows=np.array(rows)), shares)
    white = whole.whiten(few[rows].reshape(BLOCKS, N, 10), shares).reshape(BLOCKS, N, 5, 2)
    np.testing.assert_allclose(once, np.einsum("bngp,bngq->bgpq", white, white), rtol=1e-9, atol=1e-9 * once.max())
    np.testing.assert_allclose(whole.products(Candidate(few[rows], shared=False), shares), once, rtol=1e-12)


def spaces(rng: np.random.Generator) -> Space:
    """Blocks with missing dwells and two levels of noise, a column that all share."""
    error = 1e-5 * np.repeat([1.0, 3.0], BLOCKS // 2)[:, None] * np.ones((BLOCKS, N))
    error[1, 7], error[4, 30:33] = np.inf, np.inf
    whole = Covariance(np.tile(np.arange(N) * 30.0, (BLOCKS, 1)), error, axes=3)
    local = np.stack([np.ones((BLOCKS, N)), rng.standard_normal((BLOCKS, N))], axis=-1)
    noise = Noise(SHARES, rng.uniform(0.8, 1.2, BLOCKS))
    return Space(whole, noise, rng.standard_normal((BLOCKS, N)), local, rng.standard_normal((BLOCKS, N, 1)))


@pytest.mark.parametrize("units", [None, np.array([1]), np.array([0, 1])])
def test_the_gain_of_columns_is_that_of_least_squares_on_whitened_columns(rng, units):
    space = spaces(rng)
    blocks = np.arange(BLOCKS) if units is None else (3 * units[:, None] + np.arange(3)).reshape(-1)
    columns = rng.standard_normal((blocks.size, N, 4, 2))
    found = space.gain(Candidate(columns, shared=True, units=units))
    expected = []
    for some in [blocks] if units is None else np.split(blocks, units.size):
        for g in range(4):
            whole = np.zeros((BLOCKS, N, 2))
            whole[some] = columns[np.isin(blocks, some), :, g]
            both = np.concatenate([space.targets[..., 1:], space.project(space.whiten(whole))], axis=-1).reshape(-1, 3)
            y = space.targets[..., 0].reshape(-1)
            left = [y - x @ np.linalg.lstsq(x, y, rcond=None)[0] for x in (both[:, :1], both)]
            expected.append(float(left[0] @ left[0] - left[1] @ left[1]))
    assert found.drop.shape == (4 * (1 if units is None else units.size),)
    np.testing.assert_allclose(found.drop, expected, rtol=1e-8)


def test_the_gain_of_each_block_is_what_it_loses_itself_beside_columns_that_all_share(rng: np.random.Generator) -> None:
    space = spaces(rng)
    space.targets[..., 0] += 40.0 * space.targets[..., 1]  # a change that all blocks share is no gain of a block
    space.gram = np.einsum("bnt,bns->ts", space.targets, space.targets)
    columns = rng.standard_normal((BLOCKS, N, 4, 2))
    found = space.gain(Candidate(columns, shared=False))
    whole = space.project(space.whiten(columns.reshape(BLOCKS, N, 8))).reshape(BLOCKS, N, 4, 2)
    z, y = space.targets[..., 1], space.targets[..., 0]
    for g in range(4):
        q = np.linalg.qr(whole[:, :, g])[0]
        after_z, after_y = (v - (q @ (np.swapaxes(q, -1, -2) @ v[..., None]))[..., 0] for v in (z, y))
        left = after_y - after_z * float(np.sum(after_z * after_y) / np.sum(after_z**2))
        before = y - z * float(np.sum(z * y) / np.sum(z**2))
        expected = np.sum(before**2, axis=1) - np.sum(left**2, axis=1)
        np.testing.assert_allclose(found.by_block[:, g], expected, rtol=1e-6, atol=1e-6)
        # with coefficients by axis that both units share, beside the shared column as it is
        by_axis = whole[:, :, g].reshape(2, 3, N, 2).swapaxes(0, 1).reshape(3, 2 * N, 2)
        both = before.reshape(2, 3, N).swapaxes(0, 1).reshape(3, 2 * N)
        left = [v - x @ np.linalg.lstsq(x, v, rcond=None)[0] for x, v in zip(by_axis, both, strict=True)]
        assert float(found.common[g]) == pytest.approx(np.sum(before**2) - np.sum(np.square(left)), rel=1e-6)
    np.testing.assert_allclose(found.by_block.sum(axis=0), found.drop, rtol=1e-6)
    assert np.all(found.common <= found.drop)


def test_a_deleted_dwell_deviates_as_the_inverse_of_the_covariance_says(rng: np.random.Generator) -> None:
    space = spaces(rng)
    left, size = space.deleted
    for members, whitener in space.covariance.whiteners(space.noise.shares):
        for b in members.tolist():
            roots = space.project((whitener / (space.covariance.level * space.noise.scale)[b])[None], np.array([b]))[0]
            p = roots.T @ roots
            np.testing.assert_allclose(size[b], np.diagonal(p), rtol=1e-9, atol=1e-12 * p.max())
            np.testing.assert_allclose(left[b], roots.T @ space.residual[b], rtol=1e-9, atol=1e-9 * np.abs(left).max())
            np.testing.assert_allclose(space.projector_at(b, 5), p[:, 5], rtol=1e-9, atol=1e-12 * p.max())


@pytest.mark.parametrize("p", [1, 2, 3])
def test_what_a_candidate_takes_off_draws_is_what_least_squares_takes_off(rng: np.random.Generator, p: int) -> None:
    noise = Noise(SHARES, rng.uniform(0.8, 1.2, BLOCKS))
    local = np.stack([np.ones((BLOCKS, N)), rng.standard_normal((BLOCKS, N))], axis=-1)
    space = Space(covariance(rng), noise, rng.standard_normal((BLOCKS, N)), local, np.zeros((BLOCKS, N, 0)))
    columns = rng.standard_normal((BLOCKS, N, 4, p))
    columns[2, :, 1, 0] = 3.0 * local[2, :, 1]  # the model has it already
    draws = np.concatenate([space.residual[..., None], space.project(rng.standard_normal((BLOCKS, N, 6)))], axis=-1)
    candidate = Candidate(columns, shared=False)
    found, gain = Directions.of(space, candidate, together=True), space.gain(candidate)
    drops = list(found.drops(times_rows(space.backed(draws), candidate)))
    # with coefficients of each block, and by axis of both units together
    groups = [*([[b] for b in range(BLOCKS)],) * 4, *([[axis, axis + 3] for axis in range(3)],) * 4]
    for g, ((drop, rank, _), group) in enumerate(zip(drops, groups, strict=True)):
        expected, seen = np.zeros(7), 0
        white = space.whiten(columns[:, :, g % 4])
        for some in group:
            white_some = white[some].reshape(-1, p)
            left = space.project(white[some], np.array(some)).reshape(-1, p) / np.linalg.norm(white_some, axis=0)
            u, s, _ = np.linalg.svd(left, full_matrices=False)
            expected += np.sum((u[:, s > SEEN].T @ draws[some].reshape(-1, 7)) ** 2, axis=0)
            seen += int(np.sum(s > SEEN))
        assert rank == seen
        np.testing.assert_allclose(drop, expected, rtol=1e-9)
    np.testing.assert_allclose(np.append(gain.drop, gain.common), [drop[0] for drop, _, _ in drops], rtol=1e-9)
    assert [*gain.rank.tolist(), *gain.common_rank.tolist()] == [rank for _, rank, _ in drops]


def test_drawn_noise_is_white_again_after_the_whitener(rng: np.random.Generator) -> None:
    whole, noise = spaces(rng).covariance, Noise(SHARES, rng.uniform(0.8, 1.2, BLOCKS))
    normal = rng.standard_normal((BLOCKS, 7, N))
    rows = whole.coloured(noise, normal.copy())
    assert np.all(rows[~np.broadcast_to(whole.there[:, None], rows.shape)] == 0.0)
    white = whole.whiten(np.swapaxes(rows, 1, 2), SHARES) / noise.scale[:, None, None]
    expected = np.where(whole.there[..., None], np.swapaxes(normal, 1, 2), 0.0)
    np.testing.assert_allclose(white, expected, rtol=1e-9, atol=1e-9)
    for blocks in (slice(0, 2), slice(2, BLOCKS)):
        again = whole.white_rows(rows[blocks].copy(), SHARES, blocks)
        again /= (whole.level * noise.scale)[blocks, None, None]
        np.testing.assert_allclose(again, np.swapaxes(expected, 1, 2)[blocks], rtol=1e-9, atol=1e-9)


def test_a_shared_column_that_a_candidate_explains_completely_explains_nothing_more():
    whole = np.array([[9.0, 3.0, 1.0], [3.0, 4.0, 0.0], [1.0, 0.0, 2.0]])
    for rounding in (0.0, 1e-17, -1e-17):
        left = np.array([[9.0, 1e-9, 1.0], [1e-9, rounding, 0.0], [1.0, 0.0, 2.0]])
        assert schur(left, whole) == pytest.approx(9.0 - 0.5)
