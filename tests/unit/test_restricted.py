"""The likelihood on a grid against the generalised least squares that it stands for, share by share."""

import numpy as np
import pytest

from inertial.fits import restricted
from inertial.fits.generalised import Series
from inertial.fits.wander import wander_kernels


def series(rng: np.random.Generator, blocks: int = 4, n: int = 40) -> Series:
    time = np.cumsum(rng.uniform(10.0, 40.0, n))
    h = np.concatenate([np.ones((blocks, 3, n, 1)), rng.normal(size=(blocks, 3, n, 3))], axis=-1)
    z = (
        1e5 * h.sum(axis=-1)
        + rng.normal(size=(blocks, 3, n))
        + 0.3 * np.cumsum(rng.normal(size=(blocks, 3, n)), axis=-1)
    )
    return Series(h, np.zeros((blocks, 3, n, 0)), z, rng.uniform(0.9, 1.1, n), wander_kernels(time))


def test_the_grid_holds_the_deviance_of_the_fit_at_every_pair_of_shares(rng: np.random.Generator) -> None:
    own = series(rng)
    first, second = np.array([0.0, 0.1, 3.0, 1e4]), np.array([0.0, 0.5, 20.0])
    one_by_one = np.array([[own.solve((s, t)).deviance for t in second] for s in first])
    np.testing.assert_allclose(own.deviances(first, second), one_by_one, rtol=0.0, atol=1e-6)


def test_blocks_that_are_not_sound_take_no_part(rng: np.random.Generator) -> None:
    own = series(rng)
    own.sound[1, 2] = False
    shares = np.array([0.0, 1.0])
    one_by_one = np.array([[own.solve((s, t)).deviance for t in shares] for s in shares])
    np.testing.assert_allclose(own.deviances(shares, shares), one_by_one, rtol=0.0, atol=1e-6)


def test_large_lots_in_pieces_give_the_same(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    own, shares = series(rng), np.array([0.0, 0.7, 9.0])
    whole = own.deviances(shares, shares)
    monkeypatch.setattr(restricted, "_PIECE", 5)
    np.testing.assert_allclose(own.deviances(shares, shares), whole, rtol=0.0, atol=1e-8)


def test_shares_that_made_the_series_are_found(rng: np.random.Generator) -> None:
    own = series(rng, blocks=30)
    flicker, walk = own.best_shares()
    assert walk > 10.0 * max(flicker, 0.01)  # what was added is a random walk: 40 steps of 0.3
    assert walk == pytest.approx(40 * 0.09, rel=0.5)
