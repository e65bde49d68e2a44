"""Two populations are told from one of any usual form."""

from collections.abc import Callable

import numpy as np
import pytest
from long_suites import mostly_slow

from inertial.discovery.populations import two_populations

NEEDED = float(np.log(20 * 60))
ONE: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "normal": lambda rng, n: rng.standard_normal(n),
    "t4": lambda rng, n: rng.standard_t(4, n),
    "gamma": lambda rng, n: rng.gamma(8.0, 1.0, n),
    "laplace": lambda rng, n: rng.laplace(size=n),
    "uniform": lambda rng, n: rng.uniform(size=n),
    "lots shifted": lambda rng, n: rng.standard_normal(n) + np.repeat(rng.standard_normal(n // 8), 8),
}


@pytest.mark.parametrize("law", mostly_slow(ONE, "normal"))
def test_one_population_is_not_taken_for_two(law: str) -> None:
    for seed in (1, 2):
        found = two_populations(ONE[law](np.random.default_rng(seed), 2000), np.random.default_rng(seed))
        assert found is not None
        assert found.log_e < NEEDED


@pytest.mark.parametrize(("share", "apart"), mostly_slow([(0.5, 3.5), (0.1, 4.0), (0.02, 5.0)], (0.1, 4.0)))
def test_two_are_found_with_their_share_and_means(share: float, apart: float) -> None:
    rng = np.random.default_rng(7)
    n = 4000
    values = 3.0 + 2.0 * (rng.standard_normal(n) + apart * (rng.random(n) < share))
    found = two_populations(values, rng)
    assert found is not None
    assert found.log_e > NEEDED
    assert min(found.share, 1.0 - found.share) == pytest.approx(share, abs=0.03)
    assert abs(found.means[0] - found.means[1]) == pytest.approx(2.0 * apart, rel=0.15)


def test_few_or_equal_values_are_not_judged(rng: np.random.Generator) -> None:
    assert two_populations(rng.standard_normal(199), rng) is None
    assert two_populations(np.ones(500), rng) is None
    assert two_populations(np.full(500, np.nan), rng) is None
