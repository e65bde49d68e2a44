"""Correlations of coefficients, two populations in them, and free functions of the pose."""

from collections.abc import Callable

import numpy as np
import pytest
from long_suites import mostly_slow

from inertial.discovery.correlations import Correlations
from inertial.discovery.populations import two_populations
from inertial.discovery.pose_shape import COUNT, harmonics, map_of

LOTS, OF_A_LOT = 400, 8


def line(correlation: float, share: float, seed: int) -> Correlations:
    """Lots whose fits have errors of a share of the variance, correlated by −0.76, as those of soaks at 25, 55 and 80 °C."""
    rng = np.random.default_rng(seed)
    own = np.array([[1.0, correlation], [correlation, 1.0]])
    error = share * np.array([[1.0, -0.76], [-0.76, 1.0]])
    found = Correlations()
    for _ in range(LOTS):
        shift = rng.standard_normal((1, 1, 2))  # what the lot has in common
        values, errors = (rng.multivariate_normal(np.zeros(2), matrix, (OF_A_LOT, 3)) for matrix in (own, error))
        found.add(shift + values + errors, np.broadcast_to(error, (OF_A_LOT, 3, 2, 2)))
    return found


@pytest.mark.slow
def test_correlated_errors_of_the_fits_are_no_correlation_of_the_devices() -> None:
    assert [line(0.0, 0.2, seed).found(0.05) for seed in range(8)] == [[]] * 8
    rng, plain = np.random.default_rng(1), Correlations()
    error = 0.2 * np.array([[1.0, -0.76], [-0.76, 1.0]])
    for _ in range(LOTS):  # the same without what the fit says of its errors
        values = rng.standard_normal((OF_A_LOT, 3, 2)) + rng.multivariate_normal([0, 0], error, (OF_A_LOT, 3))
        plain.add(values, np.zeros((OF_A_LOT, 3, 2, 2)))
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


def sphere(n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Directions (n², 3) and their shares of the sphere: Gauss's points in height, even ones around."""
    z, weight = np.polynomial.legendre.leggauss(n)
    around = 2.0 * np.pi * np.arange(n) / n
    across = np.sqrt(1.0 - z**2)
    x, y = across[:, None] * np.cos(around), across[:, None] * np.sin(around)
    directions = np.stack(np.broadcast_arrays(x, y, z[:, None]), -1)
    return directions.reshape(-1, 3), np.repeat(weight / (2.0 * n), n)


def test_functions_are_orthogonal_of_rms_one_and_without_bias_scale_and_misalignment() -> None:
    directions, share = sphere()
    columns = np.column_stack([np.ones(len(directions)), directions * np.sqrt(3.0), harmonics(directions)])
    assert columns.T * share @ columns == pytest.approx(np.eye(4 + COUNT), abs=1e-12)
    assert harmonics(0.3 * directions) == pytest.approx(harmonics(directions))
    assert not harmonics(np.zeros((2, 3))).any()


@pytest.mark.slow
def test_a_map_is_a_function_of_degree_four_less_what_a_linear_model_takes() -> None:
    directions, share = sphere(8)
    function = directions[:, 0] ** 2 * directions[:, 1]
    size = harmonics(directions).T @ (share * function)
    twist = np.diag(np.linspace(1.0, 2.0, COUNT) * 1e-6)
    left, error = map_of(directions, size, twist)
    linear = np.column_stack([np.ones(len(directions)), directions])
    assert left == pytest.approx(function - linear @ np.linalg.lstsq(linear, function, rcond=None)[0], abs=1e-12)
    drawn = np.random.default_rng(4).multivariate_normal(np.zeros(COUNT), twist, 4000)
    scatter = np.std([map_of(directions, one, twist)[0] for one in drawn], axis=0)
    assert error == pytest.approx(scatter, rel=0.08)
