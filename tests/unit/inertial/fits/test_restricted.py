"""The likelihood on a grid against the generalised least squares that it stands for, share by share."""

import numpy as np
import pytest

from inertial.fits import generalised
from inertial.fits.generalised import Series
from inertial.fits.wander import wander_kernels


def series(rng: np.random.Generator, blocks: int = 4, n: int = 40) -> Series:
    time = np.cumsum(rng.uniform(10.0, 40.0, n))
    h = np.concatenate([np.ones((blocks, 3, n, 1)), rng.normal(size=(blocks, 3, n, 3))], axis=-1)
    white, steps = rng.normal(size=(2, blocks, 3, n))
    z = 1e5 * h.sum(axis=-1) + white + 0.3 * np.cumsum(steps, axis=-1)
    return Series(h, np.zeros((blocks, 3, n, 0)), z, rng.uniform(0.9, 1.1, n), wander_kernels(time))


def assert_grid_is_the_fit(own: Series, first: np.ndarray, second: np.ndarray) -> None:
    one_by_one = np.array([[own.solve((s, t)).deviance for t in second] for s in first])
    np.testing.assert_allclose(own.deviances(first, second), one_by_one, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("sound", ["all", "all but one", "one"])
def test_the_grid_holds_the_deviance_of_the_fit_of_the_sound_blocks(rng: np.random.Generator, sound: str) -> None:
    own = series(rng)
    if sound != "all":
        own.sound[:] = sound != "one"
        own.sound[1, 2] = sound == "one"
    assert_grid_is_the_fit(own, np.array([0.0, 0.1, 3.0, 1e4]), np.array([0.0, 0.5, 20.0]))


def test_columns_that_all_blocks_have_are_taken_out_wherever_they_stand(rng: np.random.Generator) -> None:
    n, time = 40, np.cumsum(rng.uniform(10.0, 40.0, 40))
    poses, own = rng.normal(size=(n, 3)), rng.normal(size=(4, 3, n, 2))
    turned = [np.column_stack([np.ones(n), np.roll(poses, -axis, axis=1)]) for axis in range(3)]
    h = np.concatenate([own[..., :1], np.broadcast_to(np.stack(turned), (4, 3, n, 4)), own[..., 1:]], axis=-1)
    z = 1e4 * h.sum(axis=-1) + np.cumsum(rng.normal(size=(4, 3, n)), axis=-1)
    lot = Series(h, np.zeros((4, 3, n, 0)), z, rng.uniform(0.9, 1.1, n), wander_kernels(time))
    assert_grid_is_the_fit(lot, np.array([0.0, 0.4, 70.0]), np.array([0.0, 0.4, 70.0]))
    alone = generalised.Restricted(h.reshape(-1, n, 6), z.reshape(-1, n), lot.white, lot.kernels)
    assert alone.width == 3  # the two columns of its own, and the measurements


def test_large_lots_in_pieces_give_the_same(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    own, shares = series(rng), np.array([0.0, 0.7, 9.0])
    whole = own.deviances(shares, shares)
    monkeypatch.setattr(generalised, "_PIECE", 5)
    np.testing.assert_allclose(own.deviances(shares, shares), whole, rtol=0.0, atol=1e-8)


def test_shares_that_made_the_series_are_found(rng: np.random.Generator) -> None:
    own = series(rng, blocks=30)
    flicker, walk = own.best_shares()
    assert walk > 10.0 * max(flicker, 0.01)  # what was added is a random walk: 40 steps of 0.3
    assert walk == pytest.approx(40 * 0.09, rel=0.5)


def test_a_measurement_that_a_block_lacks_is_as_if_it_had_never_been(rng: np.random.Generator) -> None:
    n, shares = 30, (2.0, 0.7)
    time, kept = np.cumsum(rng.uniform(10.0, 40.0, n)), np.ones(n, dtype=bool)
    kept[[4, 17]] = False
    h, s, z = rng.normal(size=(1, 3, n, 4)), rng.normal(size=(1, 3, n, 1)), rng.normal(size=(1, 3, n))
    z[..., ~kept] = 100.0
    profile, kernels = rng.uniform(0.9, 1.1, n), wander_kernels(time)
    cut = tuple(kernel[np.ix_(kept, kept)] for kernel in kernels)
    without = Series(h[:, :, kept], s[:, :, kept], z[..., kept], profile[kept], cut).solve(shares)
    gaps = Series(h, s, z, profile, kernels, ~kept[None])
    found = gaps.solve(shares)
    assert gaps.dof.tolist() == [[24, 24, 24]]
    for name in ("theta", "inverse", "shared", "shared_inverse", "squares", "variance"):
        np.testing.assert_allclose(getattr(found, name), getattr(without, name), rtol=1e-7, err_msg=name)
    np.testing.assert_allclose(found.gain[..., kept], without.gain, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.gain[..., ~kept], 0.0, atol=1e-9)
    other = (0.0, 3.0)
    apart = Series(h[:, :, kept], s[:, :, kept], z[..., kept], profile[kept], cut).solve(other).deviance
    assert gaps.solve(other).deviance - found.deviance == pytest.approx(apart - without.deviance, abs=1e-6)


def test_blocks_without_gaps_are_untouched_by_those_with_gaps(rng: np.random.Generator) -> None:
    own, missing = series(rng, blocks=2), np.zeros((2, 40), dtype=bool)
    missing[1, [3, 30]] = True
    beside = Series(own._h * own._scale, own._s, own._z, np.sqrt(np.diagonal(own.white)), own.kernels, missing)
    one, other = own.solve((1.0, 2.0)), beside.solve((1.0, 2.0))
    assert beside.dof.tolist() == [[36] * 3, [34] * 3]
    for name in ("theta", "inverse", "squares"):
        np.testing.assert_allclose(getattr(other, name)[0], getattr(one, name)[0], rtol=1e-9, err_msg=name)
        assert not np.allclose(getattr(other, name)[1], getattr(one, name)[1], rtol=1e-9), name
