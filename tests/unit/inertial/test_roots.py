"""Roots by Brent's method are those of scipy.optimize."""

import numpy as np
import pytest
from scipy import optimize

from inertial.roots import root


@pytest.mark.parametrize("place", [3e-6, 0.02, 0.4, 0.999])
@pytest.mark.parametrize("steep", [0.3, 3.0, 200.0])
def test_the_root_is_that_of_scipy(place: float, steep: float) -> None:
    def rises(x: float) -> float:
        return float(np.tanh(steep * (x / place - 1.0)) + 0.01 * (x / place - 1.0))

    assert root(rises, 1e-9, 1.0) == optimize.brentq(rises, 1e-9, 1.0)


def test_roots_at_ends_and_at_jumps_are_found_and_without_a_change_of_sign_there_is_none() -> None:
    assert [root(lambda x: x, *ends) for ends in ((0.0, 1.0), (-1.0, 0.0))] == [0.0, 0.0]
    assert root(lambda x: -1.0 if x < 0.3 else 1.0, 0.0, 1.0) == pytest.approx(0.3, abs=4e-12)
    with pytest.raises(ValueError, match="no change of sign"):
        root(lambda x: x + 2.0, 0.0, 1.0)
