"""The drift filter tracks a bias as well as it says, and no better where nothing tells bias from force."""

import numpy as np
import pytest

from inertial.noise import generate
from inertial.noise.allan import overlapping
from inertial.noise.kalman import Drift, DriftFilter, drift_from_terms
from inertial.noise.terms import fit_terms

RATE = 100.0
CHANNELS, SAMPLES = 200, 3000


def drift(walk: float) -> Drift:
    ones = np.ones(CHANNELS)
    return Drift(white=1e-4 * ones, instability=1e-3 * ones, walk=walk * ones, correlation_s=100.0)


@pytest.mark.parametrize("walk", [0.0, 1e-4])
def test_the_error_of_the_bias_is_what_the_filter_says(walk: float, rng: np.random.Generator) -> None:
    model = drift(walk)
    shape = (CHANNELS, SAMPLES)
    if walk:
        bias = rng.normal(scale=1e-3, size=(CHANNELS, 1)) + generate.random_walk(rng, shape, walk, RATE)
    else:
        keep = np.exp(-1.0 / (RATE * model.correlation_s))
        bias = np.empty(shape)
        bias[:, 0] = rng.normal(scale=1e-3, size=CHANNELS)
        kicks = rng.normal(scale=1e-3 * np.sqrt(1.0 - keep**2), size=shape)
        for k in range(1, SAMPLES):
            bias[:, k] = keep * bias[:, k - 1] + kicks[:, k]
    output = 1.0 + bias + generate.white(rng, shape, 1e-4 * np.sqrt(2.0), RATE)
    tracker = DriftFilter(model, RATE)
    for k in range(SAMPLES):
        tracker.step(output[:, k], np.ones(CHANNELS))
    pulls = (tracker.bias - bias[:, -1]) / tracker.bias_sd
    assert abs(pulls.mean()) < 0.25
    assert 0.85 < pulls.std() < 1.15
    assert np.std(bias[:, -1]) > 3.0 * tracker.bias_sd[0]


def test_without_a_reference_the_bias_stays_unknown(rng: np.random.Generator) -> None:
    tracker = DriftFilter(drift(0.0), RATE)
    for _ in range(500):
        tracker.step(1.0 + 1e-3 * rng.normal(size=CHANNELS), np.full(CHANNELS, np.nan))
    assert np.all(tracker.bias_sd > 0.95e-3)


def test_takes_its_noise_from_the_allan_analysis(rng: np.random.Generator) -> None:
    x = generate.white(rng, (2, 60_000), 1e-4 * np.sqrt(2.0), RATE)
    model = drift_from_terms(fit_terms(overlapping(x, RATE)), 100.0)
    assert model.white == pytest.approx(1e-4, rel=0.02)
    assert np.all(model.instability > 0.0)
