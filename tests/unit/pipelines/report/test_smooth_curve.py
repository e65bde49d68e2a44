"""The smooth curve through residuals."""

import numpy as np

from pipelines.report.smooth_curve import band


def test_the_curve_of_a_swing_follows_it_and_that_of_five_knots_does_not() -> None:
    rng = np.random.default_rng(31)
    hours = np.sort(rng.uniform(0.0, 4.0, 190))
    residual = 30.0 * np.sin(2.0 * np.pi * hours / 0.7 + 0.4) + 8.0 * rng.standard_normal(hours.size)
    off = []
    for period in (0.7, None):
        places, low, high = band(hours, residual, period)
        assert np.all(high > low)
        off.append(np.sqrt(np.mean((0.5 * (low + high) - 30.0 * np.sin(2.0 * np.pi * places / 0.7 + 0.4)) ** 2)))
    # three coefficients of 190 points with 8 of noise
    assert off[0] < 3.0 * 8.0 * np.sqrt(3.0 / 190.0)
    assert off[1] > 15.0
