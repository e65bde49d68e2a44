"""The filter of the bias against noise that its own processes have not made: 1/f by fractional integration, walk, white."""

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import chi2

from inertial.noise import generate
from inertial.noise.allan import overlapping
from inertial.noise.bias_filter import track
from inertial.noise.gauss_markov import bias_model, flicker_of_steps, step_of_process, step_of_walk
from inertial.noise.likely_terms import LikelyTerms, likely_terms
from pipelines.export.corrected import _within_a_step

FINE = 8  # values of the flicker in a mean
PAST = 4096  # means before the first that is used
UPDATES, GAPS = 400, (0, 60, 600)


def flicker_means(rng: np.random.Generator, channels: int, n: int) -> np.ndarray:
    """Means over a second (channels, n) of flicker noise with B = 1 that has run before."""
    return generate.flicker(rng, (channels, FINE * (PAST + n)), 1.0).reshape(channels, -1, FINE).mean(axis=-1)[:, PAST:]


@pytest.mark.parametrize(("correlation_s", "seconds"), [(0.5, 1.0), (40.0, 1.0), (1e4, 2.0), (3.0, 30.0)])
def test_a_step_has_the_covariances_of_the_integrals(correlation_s: float, seconds: float) -> None:
    """The stationary covariance s²·e^(−|t|/T), integrated over the step numerically."""
    sd, end = 2.0, seconds
    step = step_of_process(sd, correlation_s, seconds)
    covariance = lambda a, b: sd**2 * np.exp(-abs(a - b) / correlation_s)  # noqa: E731
    lower = dblquad(covariance, 0.0, seconds, 0.0, lambda a: a, epsabs=1e-12, epsrel=1e-10)[0]
    mean = 2.0 * lower / seconds**2
    grid = (np.arange(20_000) + 0.5) * seconds / 20_000
    with_end, with_start = (float(np.mean([covariance(t, place) for t in grid])) for place in (end, 0.0))
    assert step.weight == pytest.approx(with_start / sd**2, rel=1e-6)
    assert step.weight**2 * sd**2 + step.mean_variance == pytest.approx(mean, rel=1e-8)
    assert step.keep * step.weight * sd**2 + step.covariance == pytest.approx(with_end, rel=1e-6)
    assert step.keep**2 * sd**2 + step.end_variance == pytest.approx(sd**2, rel=1e-12)


def test_the_series_of_short_steps_continues_the_closed_form() -> None:
    above, below = (step_of_process(1.0, 1.0, 1e-3 * factor).mean_variance for factor in (1.0 + 1e-6, 1.0 - 1e-6))
    assert above == pytest.approx(below, rel=1e-5)
    slow, walk = step_of_process(1.0, 1e9, 1.0), step_of_walk(np.sqrt(2e-9), 1.0)  # K² = 2s²/T
    assert (slow.mean_variance, slow.covariance) == pytest.approx((walk.mean_variance, walk.covariance), rel=1e-6)


def test_the_innovations_of_flicker_noise_are_white_and_as_large_as_stated(rng: np.random.Generator) -> None:
    n, runs = 1500, 8
    model = bias_model([0.05] * 3, [1.0] * 3, [0.0] * 3, [3.0] * 3, flicker_of_steps(1.0, n))
    truth = flicker_means(rng, 3 * runs, n).reshape(runs, 3, n).transpose(0, 2, 1)
    known = np.zeros((n, 3))
    estimates = [
        track(model, np.arange(float(n)), one + 0.05 * rng.standard_normal(one.shape), known, np.full(n, np.nan), 1.0)
        for one in truth
    ]
    values = 3 * n * runs
    low, high = chi2.ppf([0.005, 0.995], values) / values
    # the approximation of 1/f by five processes is allowed one per cent
    assert low - 0.01 < np.mean([one.consistency.nis for one in estimates]) < high + 0.01
    assert abs(np.mean([one.consistency.lag_1 for one in estimates])) < 2.58 / np.sqrt(values) + 0.01
    assert np.mean([one.consistency.stated == "consistent" for one in estimates]) >= 0.6


@pytest.mark.parametrize(("white", "walk"), [(0.05, 0.0), (1.0, 0.0), (0.05, 0.05)])
def test_a_record_and_its_allan_fit_state_the_error_of_the_bias(white: float, walk: float) -> None:
    """Half an hour at rest gives N, B and K; then updates, and none for up to ten minutes; B = 1."""
    rng, record, runs = np.random.default_rng([31, round(100 * white), round(100 * walk)]), 1800, 14
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
        model = bias_model(
            terms.white, terms.instability, terms.walk, [3.0] * 3, flicker_of_steps(1.0, float(steps[-1]))
        )
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


def test_one_walk_for_all_channels_is_the_true_one_where_it_shows_and_none_where_there_is_none() -> None:
    rng = np.random.default_rng(77)
    walks = {0.0: [], 0.2: []}
    for walk, own in walks.items():
        for _ in range(5):
            x = flicker_means(rng, 3, 1800) + walk * np.cumsum(rng.standard_normal((3, 1800)), axis=1)
            curve = overlapping(x, 1.0)
            terms = likely_terms(curve.deviation, curve.m, curve.n, 1.0)
            assert np.all(terms.white > 0.0)
            own.append(float(np.sqrt(np.mean(terms.walk**2))))
    assert np.median(walks[0.0]) == 0.0
    assert max(walks[0.0]) < 0.15
    assert np.median(walks[0.2]) == pytest.approx(0.2, rel=0.3)


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
