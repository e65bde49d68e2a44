"""The bias filter's figures against closed forms, facts and simulated noise that is not of the filter's own making."""

import numpy as np
import pytest

from inertial.noise import generate
from inertial.noise.allan import overlapping
from inertial.noise.bias_filter import BiasFilter, consistency, track
from inertial.noise.gauss_markov import (
    AT_MAXIMUM,
    FLICKER_VARIANCE,
    BiasModel,
    FlickerTerms,
    allan_variance,
    bias_model,
    flicker_terms,
)


def one_process(white: float, sd: float, correlation_s: float, walk: float = 0.0, turn_on: float = 0.0) -> BiasModel:
    ones = np.ones(3)
    return BiasModel(white * ones, sd * np.ones((3, 1)), np.array([correlation_s]), walk * ones, turn_on * ones)


def processes(rng: np.random.Generator, model: BiasModel, runs: int, n: int, step: float) -> np.ndarray:
    """Bias (runs, n, 3) of a model, step by step with its exact recursion."""
    x = model.sd * rng.standard_normal((runs, *model.sd.shape))
    base = model.turn_on * rng.standard_normal((runs, 3))
    keep, out = np.exp(-step / model.correlation_s), np.empty((runs, n, 3))
    for k in range(n):
        if k:
            x = keep * x + model.sd * np.sqrt(1.0 - keep**2) * rng.standard_normal(x.shape)
            base = base + model.walk * np.sqrt(step) * rng.standard_normal(base.shape)
        out[:, k] = x.sum(axis=-1) + base
    return out


def test_the_allan_deviation_of_a_process_has_its_maximum_where_the_literature_has_it() -> None:
    tau = np.linspace(1.7, 2.1, 4001)
    curve = np.sqrt(allan_variance(tau, 1.0))
    assert tau[np.argmax(curve)] == pytest.approx(1.893, abs=1e-3)
    assert curve.max() == pytest.approx(0.6174, abs=1e-4)
    assert pytest.approx(1.893, rel=2e-4) == AT_MAXIMUM
    short, long = 1e-4, 1e5
    assert allan_variance(short, 1.0) == pytest.approx(2.0 * short / 3.0, rel=1e-3)  # a walk with K² = 2/T
    assert allan_variance(long, 1.0) == pytest.approx(2.0 / long, rel=1e-3)  # white with N² = 2T
    assert allan_variance(np.array([9.99e-4, 1.001e-3]), 1.0) == pytest.approx(2.0 / 3e3, rel=3e-3)


def test_the_allan_deviation_of_a_process_is_that_of_a_simulated_one(rng: np.random.Generator) -> None:
    model = one_process(0.0, 1.0, 50.0)
    x = processes(rng, model, 40, 4000, 1.0).transpose(0, 2, 1).reshape(120, -1)
    curve = overlapping(x, 1.0)
    pooled = np.sqrt(np.mean(curve.deviation**2, axis=0))
    near = (curve.tau > 4.0) & (curve.tau < 500.0)
    np.testing.assert_allclose(pooled[near], np.sqrt(allan_variance(curve.tau[near], 50.0)), rtol=0.04)


@pytest.mark.parametrize(("count", "within"), [(3, 0.09), (4, 0.02)])
def test_terms_hold_flicker_over_three_decades(count: int, within: float) -> None:
    terms = flicker_terms(1.0, 1000.0, count)
    tau = np.logspace(0.0, 3.0, 400)
    deviation = np.sqrt((terms.sd**2 * allan_variance(tau[:, None], terms.correlation_s)).sum(axis=1))
    assert np.max(np.abs(deviation / np.sqrt(FLICKER_VARIANCE) - 1.0)) < within
    assert terms.flatness < within
    assert len(terms.sd) == count


def test_a_step_is_exact_and_independent_of_its_division() -> None:
    whole, parts = (BiasFilter(one_process(1e-4, 1e-3, 30.0, walk=1e-5)) for _ in range(2))
    for tracker in (whole, parts):
        tracker.known_force(np.array([1e-3, 0.0, -2e-3]), 1.0)
    whole.predict(60.0)
    for _ in range(600):
        parts.predict(0.1)
    np.testing.assert_allclose(whole.bias, parts.bias, rtol=1e-9)
    np.testing.assert_allclose(whole.covariance, parts.covariance, rtol=1e-9)


def test_the_steady_state_with_a_known_force_is_the_closed_one() -> None:
    """√(R(−1/T + √(1/T² + q/R))), R = N², q = 2s²/T, in continuous time (facts, F)."""
    white, sd, correlation = 22.5e-6 / np.sqrt(2.0), 30e-6, 300.0
    tracker = BiasFilter(one_process(white, sd, correlation))
    for _ in range(2000):
        tracker.predict(0.2)
        tracker.known_force(np.zeros(3), 0.2)
    r, q = white**2, 2.0 * sd**2 / correlation
    closed = np.sqrt(r * (-1.0 / correlation + np.sqrt(1.0 / correlation**2 + q / r)))
    assert np.sqrt(tracker.covariance[0, 0]) == pytest.approx(closed, rel=0.02)


def test_nis_and_nees_of_its_own_model_lie_in_their_bounds(rng: np.random.Generator) -> None:
    terms = flicker_terms(1.0, 1000.0)
    model = bias_model([2e-5] * 3, [1e-5] * 3, [1e-7] * 3, [3e-4] * 3, terms)
    runs, n = 30, 200
    # a step of the filter is a mean: here over forty values of the process
    truth = processes(rng, model, runs, 40 * n, 1.0 / 40.0).reshape(runs, n, 40, 3).mean(axis=2)
    output = truth + 2e-5 * rng.standard_normal(truth.shape)
    known = np.zeros((n, 3))
    known[80:150] = np.nan  # nothing is known for 70 s
    nees, nis = [], []
    for b, y in zip(truth, output, strict=True):
        estimate = track(model, np.arange(n, dtype=float), y, known, np.full(n, np.nan), 1.0)
        for k in (79, 149, 199):
            e = estimate.bias[k] - b[k]
            nees.append(e @ np.linalg.solve(estimate.covariance[k], e))
        nis.append(estimate.consistency)
    assert 0.8 < np.mean(nees) / 3.0 < 1.2  # 270 values of χ²(1): ±0.17 at 95 %
    assert np.mean([c.stated == "consistent" for c in nis]) > 0.75  # two tests at 95 %
    assert 0.97 < np.mean([c.nis for c in nis]) < 1.03


@pytest.mark.parametrize(
    ("white", "sd", "stated"),
    [(0.3, 1.0, "too small"), (3.0, 1.0, "too large"), (1.0, 0.2, "too small"), (1.0, 5.0, "too large")],
)
def test_a_wrong_model_of_the_noise_is_not_consistent(
    white: float, sd: float, stated: str, rng: np.random.Generator
) -> None:
    right = one_process(2e-5, 1e-4, 100.0)
    wrong = one_process(2e-5 * white, 1e-4 * sd, 100.0)
    truth = processes(rng, right, 1, 1000, 1.0)[0]
    output = truth + 2e-5 * rng.standard_normal(truth.shape)
    estimate = track(wrong, np.arange(1000.0), output, np.zeros((1000, 3)), np.full(1000, np.nan), 1.0)
    assert estimate.consistency.stated == stated


def test_flicker_after_ten_minutes_of_updates_and_an_hour_without_stays_in_its_stated_deviation(
    rng: np.random.Generator,
) -> None:
    """Flicker made by fractional integration; one process with s = B instead stated 12.8 µg where it was wrong by 146."""
    b, n, block, updates = 100e-6, 4200, 5, 120
    past = generate.flicker(rng, (40, 3, n + 3600), b)[..., 3600:]  # it has run before
    means = past.reshape(40, 3, n // block, block).mean(axis=-1).transpose(0, 2, 1)
    steps = np.concatenate(
        [np.arange(updates), [140, 240, 480, n // block - 1]]
    )  # an hour without updates behind ten minutes
    model = bias_model([2e-5] * 3, [b] * 3, [0.0] * 3, [b * 3.0] * 3, flicker_terms(block, n))
    known = np.full((len(steps), 3), np.nan)
    known[:updates] = 0.0
    pulls, errors, stated = [], [], []
    for truth in means[:, steps]:
        output = truth + 2e-5 / np.sqrt(block) * rng.standard_normal(truth.shape)
        estimate = track(model, float(block) * steps, output, known, np.full(len(steps), np.nan), block)
        sd = np.sqrt(np.diagonal(estimate.covariance, axis1=1, axis2=2))
        pulls.append((estimate.bias - truth)[updates:] / sd[updates:])
        errors.append((estimate.bias - truth)[-1])
        stated.append(sd[-1])
    assert 0.8 < np.sqrt(np.mean(np.square(pulls))) < 1.2  # 480 pulls of 120 channels
    assert np.sqrt(np.mean(np.square(errors))) < 1.3 * np.mean(stated)
    naive = BiasFilter(bias_model([2e-5] * 3, [b] * 3, [0.0] * 3, [0.0] * 3, FlickerTerms(
        np.array([1.0]), np.array([100.0]), 1.0, 1.0, 0.0)))  # fmt: skip
    naive.predict(3600.0)
    assert np.sqrt(naive.covariance[0, 0]) < 0.8 * np.mean(
        stated
    )  # what B alone as a standard deviation would have stated


def test_without_a_known_force_the_bias_stays_unknown() -> None:
    model = one_process(1e-4, 1e-3, 100.0, turn_on=2e-3)
    nothing = np.full((500, 3), np.nan)
    estimate = track(model, np.arange(500.0), np.zeros((500, 3)), nothing, nothing[:, 0], 1.0)
    assert not estimate.updated.any()
    assert np.all(np.sqrt(estimate.covariance[-1].diagonal()) > 0.999 * np.hypot(1e-3, 2e-3))
    assert estimate.consistency.stated is None


def test_rest_in_one_pose_tells_the_bias_along_the_force_only(rng: np.random.Generator) -> None:
    model = one_process(2e-5, 1e-6, 1000.0, turn_on=1e-3)
    bias = np.array([6e-4, -4e-4, 8e-4])
    force = np.array([0.6, 0.0, 0.8]) + bias + 2e-5 * rng.standard_normal((400, 3))
    estimate = track(model, np.arange(400.0), force, np.full((400, 3), np.nan), np.ones(400), 1.0)
    along = np.array([0.6, 0.0, 0.8])
    sd_along = np.sqrt(along @ estimate.covariance[-1] @ along)
    assert sd_along < 5e-6
    assert abs(along @ (estimate.bias[-1] - bias)) < 4.0 * sd_along + 1e-6  # second order: |b|²/2
    assert np.sqrt(estimate.covariance[-1][1, 1]) == pytest.approx(1e-3, rel=0.01)


def test_an_outlier_is_counted_and_not_used() -> None:
    tracker = BiasFilter(one_process(1e-5, 1e-4, 100.0))
    tracker.known_force(np.array([0.5, 0.0, 0.0]), 1.0)
    assert tracker.rejected == 1
    assert tracker.bias[0] == 0.0
    assert len(tracker.innovations) == 2


def test_consistency_has_the_bounds_of_chi_square() -> None:
    """n = 50, 100, 1000: .647–1.428, .742–1.296, .914–1.090 (facts, F)."""
    for n, low, high in ((50, 0.647, 1.428), (100, 0.742, 1.296), (1000, 0.914, 1.090)):
        bounds = consistency([(0, 1.0)] * n)
        assert (bounds.low, bounds.high) == pytest.approx((low, high), abs=1e-3)


def test_a_step_whose_innovations_are_rejected_has_updated_nothing() -> None:
    nothing = np.full(3, np.nan)
    estimate = track(
        one_process(1e-5, 1e-4, 100.0), np.arange(3.0), np.full((3, 3), 0.5), np.zeros((3, 3)), nothing, 1.0
    )
    assert estimate.rejected == 9
    assert not estimate.updated.any()
