"""The noise floor of a model: what the noise of the measurement leaves in its residuals."""

import numpy as np
import pytest
from made_worlds import BASE, World, make

from inertial.criticism.examination import ExaminedRun
from inertial.estimation.comparison import fitted_residuals, rms
from inertial.estimation.model import Model
from pipelines.tables.dwells import lot_of, measured

SEED = 6_460_000


def model_with(added_ug: np.ndarray) -> Model:
    """A model of a lot of white noise with something more on each axis, (units, n, 3)."""
    made = make(World(units=len(added_ug)), SEED)
    lot = lot_of(measured(made.dwells, made.history), square=False)
    lot.output[...] += 1e-6 * added_ug
    return ExaminedRun(lot, BASE).model()


def left_ug(model: Model) -> float:
    """RMS of the residuals, µg."""
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
