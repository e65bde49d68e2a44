"""The noise floor of a model: what the noise of the measurement leaves in its residuals."""

import numpy as np
import pytest
from made_worlds import BASE, World, make

from inertial.criticism.examination import ExaminedRun
from inertial.estimation.bases import orthonormal
from inertial.estimation.comparison import fitted_residuals, rms
from inertial.estimation.covariance import Covariance
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise, Shares
from pipelines.tables.dwells import lot_of, measured

SEED = 6_460_000


def model_with(added_ug: np.ndarray) -> Model:
    """A model of a lot of white noise with something more on each axis, (units, n, 3)."""
    made = make(World(units=len(added_ug)), SEED)
    lot = lot_of(measured(made.dwells, made.history), square=False)
    lot.output[...] += 1e-6 * added_ug
    return ExaminedRun(lot, BASE).model()


def left_ug(model: Model) -> float:
    return 1e6 * rms(fitted_residuals(model))


@pytest.mark.parametrize("walk_ug", [0.0, 5.0, 20.0])
def test_it_is_what_white_noise_and_a_walk_leave_after_the_fit(walk_ug: float) -> None:
    rng = np.random.default_rng(SEED)
    shape = (4, make(World(units=1), SEED).dwells["dwell"].nunique(), 3)
    model = model_with(np.cumsum(rng.normal(0.0, walk_ug, shape), axis=1))
    assert 1e6 * model.floor() == pytest.approx(left_ug(model), rel=0.06)
    if not walk_ug:
        assert 1e6 * model.floor() == pytest.approx(make(World(units=4), SEED).floor_ug, rel=0.1)


def test_a_bounded_beat_that_looks_like_a_walk_is_no_more_than_the_residuals_hold() -> None:
    dwells = make(World(units=1), SEED).dwells["dwell"].nunique()
    beat = 20.0 * np.sin(np.arange(dwells) / 2.5)[None, :, None] * np.ones((4, 1, 3))
    model = model_with(beat)
    assert 1e6 * model.floor() <= 1.001 * left_ug(model)


@pytest.mark.parametrize("shares", [Shares(), Shares(flicker=10.0), Shares(walk=100.0)])
def test_what_noise_leaves_is_the_mean_of_least_squares_on_noise_that_is_drawn(shares: Shares) -> None:
    rng = np.random.default_rng(SEED)
    blocks, n, draws = 3, 30, 4000
    time = np.tile(60.0 * np.arange(n), (blocks, 1))
    error = 1e-5 * np.where(np.arange(n) % 3, 1.0, 6.0) * np.array([1.0, 1.2, 0.9])[:, None]
    error[1, 4:7] = np.inf
    there = np.isfinite(error)
    covariance = Covariance(time, error)
    noise = Noise(shares, np.array([1.0, 1.5, 0.8]))
    # bias and slope of each block, one column that all share
    own = np.stack([np.ones((blocks, n)), np.broadcast_to(np.linspace(-1.0, 1.0, n), (blocks, n))], axis=-1)
    same = rng.normal(size=(blocks, n))
    design = np.column_stack([np.kron(np.eye(blocks), own[0]), same.ravel()])
    weight = np.where(there, covariance.level[:, None] / error, 0.0).ravel()
    drawn = covariance.coloured(noise, rng.standard_normal((blocks, draws, n)))
    series = np.swapaxes(drawn, 0, 1).reshape(draws, -1).T
    fitted = design @ np.linalg.lstsq(design * weight[:, None], series * weight[:, None], rcond=None)[0]
    squares = np.sum((there.ravel()[:, None] * (series - fitted)) ** 2, axis=0)
    local = orthonormal(own * weight.reshape(blocks, n, 1))[0]
    beside = (same * weight.reshape(blocks, n))[..., None]
    beside = beside - local @ (np.swapaxes(local, 1, 2) @ beside)
    shared = orthonormal(beside.reshape(1, -1, 1))[0].reshape(beside.shape)
    left, held = covariance.squares_left(noise, local, shared, np.zeros((blocks, n)))
    assert held == 0.0
    assert left == pytest.approx(squares.mean(), abs=4.0 * squares.std() / np.sqrt(draws))
    assert left < np.sum(drawn**2) / draws  # the fit takes its part
