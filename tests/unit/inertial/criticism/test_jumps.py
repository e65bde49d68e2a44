"""How evenly an effect's coefficients are spread: one in few axes costs what such a concentration has as probability."""

import numpy as np

from inertial.criticism.jumps import _evenness


def test_coefficients_of_one_distribution_are_even_and_two_of_many_are_not() -> None:
    rng = np.random.default_rng(5)
    even = [_evenness(40.0 * rng.standard_normal(24) ** 2) for _ in range(200)]
    assert np.mean(np.array(even) < -5.0) < 0.05
    assert _evenness(np.array([600.0, 150.0, *np.full(22, 1.0)])) < -50.0
    assert _evenness(np.array([141.0, 0.0, 0.0])) > -20.0  # three axes cannot say much
