"""What a bias is the bias of."""

import numpy as np
import pytest

from inertial.noise.measurands import walk_kernel


def test_a_walk_about_its_mean_is_a_walk_less_the_integral_over_its_record() -> None:
    fine = np.linspace(0.0, 90.0, 9001)
    whole = np.minimum.outer(fine, fine) / 90.0
    at = np.array([0, 700, 2000, 4100, 9000])
    weight = np.full(fine.size, 1.0 / (fine.size - 1))
    weight[[0, -1]] *= 0.5
    with_mean = whole @ weight
    expected = whole[np.ix_(at, at)] - with_mean[at] - with_mean[at][:, None] + weight @ with_mean
    np.testing.assert_allclose(walk_kernel(fine[at] + 1e4), expected, atol=1e-6)


def test_it_is_counted_from_the_mean_of_the_dwells_that_are_fitted() -> None:
    time = np.array([0.0, 10.0, 20.0, 30.0, 80.0, 90.0])
    fitted = time < 50.0
    inner = walk_kernel(time[fitted])
    np.testing.assert_allclose(walk_kernel(time, fitted)[np.ix_(fitted, fitted)], inner * 30.0 / 90.0, atol=1e-12)
    # differences do not depend on what the walk is counted from
    change = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    assert change @ walk_kernel(time, fitted) @ change == pytest.approx(1.0)


def test_records_of_units_have_their_own_times() -> None:
    time = np.stack([np.linspace(0.0, 50.0, 6), np.linspace(7.0, 107.0, 6)])
    both = walk_kernel(time)
    np.testing.assert_allclose(both[1], walk_kernel(time[1]) * 100.0 / 107.0, atol=1e-12)
    assert np.trace(both[1]) / np.trace(both[0]) == pytest.approx(2.0)
