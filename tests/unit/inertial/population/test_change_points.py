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


@pytest.mark.parametrize(
    ("n", "at", "memory", "size", "least"),
    [(40, 20, 0.0, 4.0, 0.85), (100, 50, 0.0, 2.0, 0.9), (120, 70, 0.0, 2.5, 0.85), (120, 70, 0.6, 6.0, 0.85)],
)
def test_a_step_is_told_where_it_is(n: int, at: int, memory: float, size: float, least: float) -> None:
    moved = made.autoregressive(np.random.default_rng(20_261_124), 40, n, memory) + size * (np.arange(n) >= at)
    assert np.mean([any(abs(c.first - at) <= 3 for c in change_points(one)) for one in moved]) >= least


def test_a_series_with_a_gap_or_a_wild_first_value_has_no_change() -> None:
    assert change_points(np.array([1.0, np.nan] * 20)) == []
    values = np.random.default_rng(20_261_123).standard_normal(60)
    values[0], values[-1] = 60.0, -60.0
    assert np.max(np.abs(drawn_in(values))) < 6.0
    assert change_points(values, 1e-2) == []
