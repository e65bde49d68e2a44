"""Correlations of coefficients: the errors of the fit correlate by themselves, what the devices have is told from them."""

import numpy as np
import pytest

from inertial.discovery.correlations import Correlations

LOTS, UNITS = 400, 8


def line(correlation: float, share: float, seed: int) -> Correlations:
    """Lots whose fits have errors of a share of the variance, correlated by −0.76, as those of soaks at 25, 55 and 80 °C."""
    rng = np.random.default_rng(seed)
    own = np.array([[1.0, correlation], [correlation, 1.0]])
    error = share * np.array([[1.0, -0.76], [-0.76, 1.0]])
    found = Correlations()
    for _ in range(LOTS):
        shift = rng.standard_normal((1, 1, 2))  # what the lot has in common
        values, errors = (rng.multivariate_normal(np.zeros(2), matrix, (UNITS, 3)) for matrix in (own, error))
        found.add(shift + values + errors, np.broadcast_to(error, (UNITS, 3, 2, 2)))
    return found


@pytest.mark.slow
def test_correlated_errors_of_the_fits_are_no_correlation_of_the_devices() -> None:
    plain = Correlations()
    found = [line(0.0, 0.2, seed) for seed in range(8)]
    assert [one.found(0.05) for one in found] == [[]] * 8
    rng = np.random.default_rng(1)
    error = 0.2 * np.array([[1.0, -0.76], [-0.76, 1.0]])
    for _ in range(LOTS):  # the same without what the fit says of its errors
        plain.add(
            rng.standard_normal((UNITS, 3, 2)) + rng.multivariate_normal([0, 0], error, (UNITS, 3)),
            np.zeros((UNITS, 3, 2, 2)),
        )
    assert len(plain.found(0.05)) == 3


def test_a_correlation_of_the_devices_is_found_with_its_size() -> None:
    found = line(0.2, 0.2, 11).found(0.05)
    assert [(one.first, one.second) for one in found] == [(0, 1)] * 3
    assert {one.axis for one in found} == {0, 1, 2}
    for one in found:
        assert one.value == pytest.approx(0.2, abs=3.0 * one.error)
        assert 0.01 < one.error < 0.03


def test_few_lots_say_nothing() -> None:
    few = Correlations()
    few.add(np.zeros((1, 3, 2)), np.zeros((1, 3, 2, 2)))
    assert (few.units, few.found(0.05)) == (0, [])
