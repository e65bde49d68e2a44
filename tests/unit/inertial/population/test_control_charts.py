"""Control charts, the memory of a series and E_n on series of an independent generator."""

import independent_noise as made
import numpy as np
import pytest

from inertial.population.agreement import e_n
from inertial.population.control_charts import alarms, baseline, chance_of_alarms, signals
from inertial.population.memory import drawn_in, innovations, memories_of, memory_of

KINDS = [(0.0, None), (0.6, None), (0.0, 3.0), (0.6, 3.0)]
NAMES = ["white", "neighbours agree by 0.6", "Student's t of 3", "both"]


def test_what_the_correlation_may_be_covers_what_it_is() -> None:
    rng = np.random.default_rng(20_261_125)
    for n in (20, 40, 100):
        held = 0
        for values in made.autoregressive(rng, 200, n, 0.6):
            low, high = np.quantile(memories_of(drawn_in(values)), (0.025, 0.975))
            held += bool(low <= 0.6 <= high)
        assert held >= 176  # 95 % of 200 are 190


def test_innovations_keep_the_level_and_lose_the_memory() -> None:
    values = 5.0 + made.autoregressive(np.random.default_rng(20_261_126), 1, 4000, 0.6)[0]
    left = innovations(values, 0.6)
    assert np.mean(left) == pytest.approx(np.mean(values), abs=0.01)
    assert memory_of(left) < 0.06
    assert innovations(values, 0.0) is values


@pytest.mark.parametrize(("memory", "dof"), KINDS, ids=NAMES)
def test_a_check_standard_in_control_is_found_out_of_it_as_seldom_as_is_said(memory: float, dof: float | None) -> None:
    first, n = 20, 40
    series = made.autoregressive(np.random.default_rng(20_261_127), 100, n, memory, dof=dof)
    assert sum(_p_of_alarms(values, first) < 0.01 for values in series) <= 4  # under 0.6 there were 5
    if memory == 0.0:
        moved = series[:30] + 3.0 * (np.arange(n) >= first)
        assert sum(_p_of_alarms(values, first) < 0.01 for values in moved) >= 27


def _p_of_alarms(values: np.ndarray, first: int) -> float:
    rules, moving = signals(values, baseline(values, first))
    chance = chance_of_alarms(values, first, values.size - first)
    return chance.p_value(alarms(rules, moving.outside, np.arange(values.size) >= first))


def test_a_coverage_factor_of_few_values_makes_e_n_smaller() -> None:
    """JCGM 100, table G.2: t at 95.45 % is 4.53, 2.65 and 2.28 for 2, 5 and 10 degrees of freedom."""
    one = np.ones(1)
    for dof, factor in ((2.0, 4.53), (5.0, 2.65), (10.0, 2.28)):
        assert e_n(one, 0.0 * one, one, 0.0 * one, dof)[0] == pytest.approx(1.0 / factor, rel=2e-3)
    assert e_n(one, 0.0 * one, one, 0.0 * one)[0] == 0.5
