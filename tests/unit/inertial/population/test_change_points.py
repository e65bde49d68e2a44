"""Changes of level: none where series stand still, and steps that are there.

Shares of 4000 series a case: `python benchmarks/noise_verdicts.py series`.
"""

import independent_noise as made
import numpy as np
import pytest

from inertial.population.change_points import change_points, noise_of
from inertial.population.memory import drawn_in


def test_a_change_of_level_is_placed_inside_its_interval(rng):
    hit = 0
    for _ in range(100):
        values = rng.standard_normal(200)
        values[120:] += 1.5
        changes = change_points(values)
        assert len(changes) == 1
        assert changes[0].shift == pytest.approx(1.5, abs=5.0 * changes[0].error)
        hit += changes[0].low <= 120 <= changes[0].high
    assert hit >= 90


def test_white_noise_has_no_change_of_level(rng):
    assert sum(len(change_points(rng.standard_normal(300))) for _ in range(200)) <= 2


def test_two_changes_and_an_outlier_are_told_apart(rng):
    values = rng.standard_normal(300)
    values[100:] += 3.0
    values[200:] -= 3.0
    values[50] += 15.0
    assert [round(change.first, -1) for change in change_points(values)] == [100, 200]
    assert noise_of(values) == pytest.approx(1.0, abs=0.2)


KINDS = [(0.0, None), (0.6, None), (0.0, 3.0), (0.6, 3.0)]
NAMES = ["white", "neighbours agree by 0.6", "Student's t of 3", "both"]


@pytest.mark.parametrize(("memory", "dof"), KINDS, ids=NAMES)
@pytest.mark.parametrize("n", [20, 40, 100])
def test_a_series_that_stands_still_changes_as_seldom_as_is_said(n: int, memory: float, dof: float | None) -> None:
    rng = np.random.default_rng([20_261_122, n])
    series = made.autoregressive(rng, 300, n, memory, dof=dof)
    p = np.array([min((one.p_value for one in change_points(values, 1e-2)), default=1.0) for values in series])
    assert np.sum(p < 1e-2) <= 8  # 3 are expected; under 0.6 there were 9 in 20 points, and of them 3 below 1e-3
    assert np.sum(p < 1e-3) <= 2


def test_a_wild_first_value_is_no_level_of_its_own() -> None:
    values = np.random.default_rng(20_261_123).standard_normal(60)
    values[0], values[-1] = 60.0, -60.0
    assert np.max(np.abs(drawn_in(values))) < 6.0
    assert change_points(values, 1e-2) == []


@pytest.mark.parametrize(("n", "size", "least"), [(40, 4.0, 34), (100, 2.0, 36)])
def test_a_step_of_white_values_is_told(n: int, size: float, least: int) -> None:
    moved = made.autoregressive(np.random.default_rng(20_261_124), 40, n, 0.0) + size * (np.arange(n) >= n // 2)
    assert sum(any(abs(one.first - n // 2) <= 3 for one in change_points(values)) for values in moved) >= least


def test_a_level_that_moved_is_still_told() -> None:
    rng = np.random.default_rng(7_310_008)
    for memory, size in ((0.0, 2.5), (0.6, 6.0)):
        series = made.autoregressive(rng, 20, 120, memory) + size * (np.arange(120) >= 70)
        assert sum(any(abs(c.first - 70) <= 3 for c in change_points(one)) for one in series) >= 17


def test_a_series_with_a_gap_has_no_change() -> None:
    assert change_points(np.array([1.0, np.nan] * 20)) == []
