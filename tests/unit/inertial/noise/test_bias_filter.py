"""The bias filter's figures against closed forms, facts and noise that is not of the filter's own making."""

import made_noise as generate
import numpy as np
import pytest
from each import each
from long_suites import mostly_slow
from scipy.stats import chi2

from inertial.noise.allan import overlapping
from inertial.noise.bias_filter import BiasFilter, consistency, track
from inertial.noise.gauss_markov import BiasModel, bias_model, flicker_of_steps, flicker_terms
from inertial.noise.terms import LikelyTerms, likely_terms
from pipelines.export.corrected import _within_a_step


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


def test_a_step_is_exact_and_independent_of_its_division() -> None:
    whole, parts = (BiasFilter(one_process(1e-4, 1e-3, 30.0, walk=1e-5)) for _ in range(2))
    for tracker, steps in ((whole, 1), (parts, 600)):
        tracker.known_force(np.array([1e-3, 0.0, -2e-3]), 1.0)
        for _ in range(steps):
            tracker.predict(60.0 / steps)
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


@each([(0.3, 1.0, "too small"), (3.0, 1.0, "too large"), (1.0, 0.2, "too small"), (1.0, 5.0, "too large")])
def test_a_wrong_model_of_the_noise_is_not_consistent(row, rng):
    white, sd, stated = row
    right, wrong = one_process(2e-5, 1e-4, 100.0), one_process(2e-5 * white, 1e-4 * sd, 100.0)
    output = processes(rng, right, 1, 1000, 1.0)[0] + 2e-5 * rng.standard_normal((1000, 3))
    estimate = track(wrong, np.arange(1000.0), output, np.zeros((1000, 3)), np.full(1000, np.nan), 1.0)
    assert estimate.consistency.stated == stated


def test_without_a_known_force_the_bias_stays_unknown_and_consistency_has_the_bounds_of_chi_square() -> None:
    model = one_process(1e-4, 1e-3, 100.0, turn_on=2e-3)
    nothing = np.full((500, 3), np.nan)
    estimate = track(model, np.arange(500.0), np.zeros((500, 3)), nothing, nothing[:, 0], 1.0)
    assert not estimate.updated.any()
    assert np.all(np.sqrt(estimate.covariance[-1].diagonal()) > 0.999 * np.hypot(1e-3, 2e-3))
    assert estimate.consistency.stated is None
    for n, low, high in ((50, 0.647, 1.428), (100, 0.742, 1.296), (1000, 0.914, 1.090)):  # facts, F: bounds of χ²
        bounds = consistency([(0, 1.0)] * n)
        assert (bounds.low, bounds.high) == pytest.approx((low, high), abs=1e-3)


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
    assert (tracker.rejected, tracker.bias[0], len(tracker.innovations)) == (1, 0.0, 2)
    estimate = track(tracker.model, np.arange(3.0), np.full((3, 3), 0.5), np.zeros((3, 3)), np.full(3, np.nan), 1.0)
    assert (estimate.rejected, estimate.updated.any()) == (9, False)


FINE = 8  # values of the flicker in a mean
PAST = 4096  # means before the first that is used
UPDATES, GAPS = 400, (0, 60, 600)


def flicker_means(rng: np.random.Generator, channels: int, n: int) -> np.ndarray:
    """Means over a second (channels, n) of flicker noise with B = 1 that has run before."""
    return generate.flicker(rng, (channels, FINE * (PAST + n)), 1.0).reshape(channels, -1, FINE).mean(axis=-1)[:, PAST:]


@pytest.mark.slow
def test_the_innovations_of_flicker_noise_are_white_and_as_large_as_stated(rng: np.random.Generator) -> None:
    n, runs = 1500, 8
    model = bias_model([0.05] * 3, [1.0] * 3, [0.0] * 3, [3.0] * 3, flicker_of_steps(1.0, n))
    truth = flicker_means(rng, 3 * runs, n).reshape(runs, 3, n).transpose(0, 2, 1)
    known = np.zeros((n, 3))
    noisy = truth + 0.05 * rng.standard_normal(truth.shape)
    estimates = [track(model, np.arange(float(n)), one, known, np.full(n, np.nan), 1.0) for one in noisy]
    values = 3 * n * runs
    low, high = chi2.ppf([0.005, 0.995], values) / values
    # the approximation of 1/f by five processes is allowed one per cent
    assert low - 0.01 < np.mean([one.consistency.nis for one in estimates]) < high + 0.01
    assert abs(np.mean([one.consistency.lag_1 for one in estimates])) < 2.58 / np.sqrt(values) + 0.01
    assert np.mean([one.consistency.stated == "consistent" for one in estimates]) >= 0.6


@pytest.mark.slow
@pytest.mark.parametrize(("white", "walk"), mostly_slow([(0.05, 0.0), (1.0, 0.0), (0.05, 0.05)], (0.05, 0.0)))
def test_a_record_and_its_allan_fit_state_the_error_of_the_bias(white: float, walk: float) -> None:
    """Half an hour at rest gives N, B and K; then updates, and none for up to ten minutes; B = 1."""
    rng, record, runs = np.random.default_rng([31, round(100 * white), round(100 * walk)]), 1800, 8
    pulls = []
    steps = np.concatenate([np.arange(UPDATES), UPDATES - 1 + np.array(GAPS[1:])])
    known = np.full((len(steps), 3), np.nan)
    known[:UPDATES] = 0.0
    for _ in range(runs):
        bias = flicker_means(rng, 3, record + UPDATES + max(GAPS))
        bias = bias + walk * np.cumsum(rng.standard_normal(bias.shape), axis=1)
        output = bias + white * rng.standard_normal(bias.shape)
        curve = overlapping(output[:, :record], 1.0)
        terms = likely_terms(curve.deviation, curve.m, curve.n, 1.0)
        processes_of_flicker = flicker_of_steps(1.0, float(steps[-1]))
        model = bias_model(terms.white, terms.instability, terms.walk, [3.0] * 3, processes_of_flicker)
        truth, seen = ((one[:, record:] - bias[:, :record].mean(axis=1, keepdims=True)).T for one in (bias, output))
        estimate = track(model, steps.astype(float), seen[steps], known, np.full(len(steps), np.nan), 1.0)
        at = [UPDATES - 1, *range(UPDATES, UPDATES + len(GAPS) - 1)]
        error = estimate.bias[at] - truth[UPDATES - 1 + np.array(GAPS)]
        pulls.append(error / np.sqrt(np.diagonal(estimate.covariance[at], axis1=1, axis2=2)))
    nees = np.mean(np.square(pulls), axis=(0, 2))
    low, high = chi2.ppf([0.005, 0.995], 3 * runs) / (3 * runs)
    assert np.all(nees[1:] > low), nees
    assert np.all(nees[1:] < high), nees
    assert nees[0] < high  # white noise that no curve tells from none is stated at the least that one would tell


@pytest.mark.slow
def test_one_walk_for_all_channels_is_the_true_one_where_it_shows_and_none_where_there_is_none() -> None:
    rng, found = np.random.default_rng(77), []
    for walk in [0.0] * 5 + [0.2] * 5:
        x = flicker_means(rng, 3, 1800) + walk * np.cumsum(rng.standard_normal((3, 1800)), axis=1)
        curve = overlapping(x, 1.0)
        terms = likely_terms(curve.deviation, curve.m, curve.n, 1.0)
        assert np.all(terms.white > 0.0)
        found.append(float(np.sqrt(np.mean(terms.walk**2))))
    assert np.median(found[:5]) == 0.0
    assert max(found[:5]) < 0.15
    assert np.median(found[5:]) == pytest.approx(0.2, rel=0.3)


def test_samples_scatter_about_the_mean_of_their_step_as_stated(rng: np.random.Generator) -> None:
    per, rate, steps = 50, 50.0, 400
    white, walk = 0.05, 0.3
    fast = generate.flicker(rng, (6, 4 * per * (steps + 40)), 1.0).reshape(6, -1, 4).mean(axis=-1)[:, 40 * per :]
    samples = fast + generate.white(rng, fast.shape, white * np.sqrt(2.0), rate)
    samples = samples + generate.random_walk(rng, fast.shape, walk, rate)
    parts = samples.reshape(6, steps, per)
    scatter = float(np.mean((parts - parts.mean(axis=-1, keepdims=True)) ** 2))
    stated = _within_a_step(LikelyTerms(np.array([white]), np.array([1.0]), np.array([walk])), per, rate)[0]
    # the white noise of the mean of a step is its own, as that of the samples is counted in full
    assert scatter == pytest.approx(float(stated), rel=0.05)
