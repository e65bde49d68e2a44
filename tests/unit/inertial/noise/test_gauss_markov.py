"""Processes of the bias: their Allan deviation, the flicker they add up to, and the moments of a step."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from inertial.noise.gauss_markov import (
    AT_MAXIMUM,
    FLICKER_VARIANCE,
    allan_variance,
    flicker_terms,
    step_of_process,
    step_of_walk,
)


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


@pytest.mark.parametrize(("count", "within"), [(3, 0.09), (4, 0.02)])
def test_terms_hold_flicker_over_three_decades(count: int, within: float) -> None:
    terms = flicker_terms(1.0, 1000.0, count)
    tau = np.logspace(0.0, 3.0, 400)
    deviation = np.sqrt((terms.sd**2 * allan_variance(tau[:, None], terms.correlation_s)).sum(axis=1))
    assert np.max(np.abs(deviation / np.sqrt(FLICKER_VARIANCE) - 1.0)) < within
    assert terms.flatness < within
    assert len(terms.sd) == count


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
