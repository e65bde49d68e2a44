"""Statistics over units on data whose truth is known: charts, levels, fingerprints, places, capability and gauge studies.

Shares of 4000 series a case: `python benchmarks/noise_verdicts.py series`.
"""

import independent_noise as made
import numpy as np
import pytest
from each import each
from long_suites import mostly_slow

from inertial.population.capability import cpk, shape_of
from inertial.population.change_points import change_points, noise_of
from inertial.population.comparison import outlier_limit, robust_z
from inertial.population.control_charts import alarms, baseline, chance_of_alarms, signals
from inertial.population.fingerprints import alike_below, change_scale, distance, foreign_above, nearest
from inertial.population.gauge import gauge_study
from inertial.population.memory import drawn_in, innovations, memories_of, memory_of
from inertial.population.two_way import unit_and_place

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


@pytest.mark.slow
@pytest.mark.parametrize(("memory", "dof"), mostly_slow(KINDS, KINDS[0]), ids=NAMES)
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


def test_a_foreign_unit_is_told_and_its_own_history_is_found(rng):
    old = 3000.0 * rng.standard_normal((500, 6))
    new = old + 50.0 * rng.standard_normal(old.shape)
    scale = change_scale(new, old)
    assert scale.count == 6
    new[[3, 8]] = new[[8, 3]]
    far = np.flatnonzero(distance(new, old, scale) > foreign_above(scale))
    assert far.tolist() == [3, 8]
    assert nearest(new[3], old, scale)[0] == 8
    assert nearest(new[3], old, scale)[1] < alike_below(scale)
    alike = np.column_stack([old[:, 0], rng.standard_normal(500)])  # the second is the same for all units
    assert change_scale(alike + rng.standard_normal(alike.shape), alike).telling.tolist() == [True, False]


def test_units_and_places_are_taken_apart(rng):
    unit, place = 2.0 * rng.standard_normal(200), rng.standard_normal(12)
    units, places = np.repeat(np.arange(200), 8), rng.integers(0, 12, 1600)
    values = unit[units] + place[places] + 0.1 * rng.standard_normal(1600)
    values[7] += 50.0
    _, estimated = unit_and_place(values, units, places)
    assert estimated == pytest.approx(place - np.median(place), abs=0.06)


def test_no_value_of_a_small_population_stands_out_by_chance(rng):
    wrong = 0
    for _ in range(300):
        values = rng.standard_normal((40, 10))
        wrong += bool(np.any(np.abs(robust_z(values)) > outlier_limit(values.size, 40)))
    assert wrong <= 12
    values[3, 5] = 30.0
    assert np.argwhere(np.abs(robust_z(values)) > outlier_limit(values.size, 40)).tolist() == [[3, 5]]


@pytest.mark.parametrize("n", mostly_slow([20, 50, 200], 20))
def test_the_interval_of_ppk_holds_for_folded_values(n: int, rng: np.random.Generator) -> None:
    mean, sigma = np.sqrt(2.0 / np.pi), np.sqrt(1.0 - 2.0 / np.pi)
    limit, held, normal, runs = mean + 4.0 * sigma, 0, 0, 1500
    for values in np.abs(rng.normal(size=(runs, n))):
        own = float(values.mean()), float(values.std(ddof=1)), -np.inf, limit, n
        index, plain = cpk(*own, shape=shape_of(values)), cpk(*own)
        held += index.low <= 4.0 / 3.0 <= index.high
        normal += plain.low <= 4.0 / 3.0 <= plain.high
    assert held / runs > 0.92
    assert normal / runs < 0.9


@pytest.mark.parametrize(
    ("shape", "part", "station", "interaction"),
    mostly_slow([((10, 3, 3), 3.0, 1.0, 0.5), ((8, 1, 3), 3.0, 0.0, 0.0)], ((10, 3, 3), 3.0, 1.0, 0.5)),
)
def test_the_intervals_of_a_gauge_study_hold(shape, part, station, interaction, rng):
    p, o, _ = shape
    gauge = float(np.sqrt(1.0 + station**2 + interaction**2))
    percent, held, runs = 100.0 * gauge / np.hypot(gauge, part), np.zeros(2), 300
    for _ in range(runs):
        values = part * rng.normal(size=(p, 1, 1)) + station * rng.normal(size=(1, o, 1)) + rng.normal(size=shape)
        study = gauge_study(values + interaction * rng.normal(size=(p, o, 1)))
        ends = study.gauge_interval, study.percent_interval
        held += [low <= true <= high for (low, high), true in zip(ends, (gauge, percent), strict=True)]
    assert np.all(held / runs > 0.91)


def test_changes_of_level_are_placed_inside_their_interval_and_told_from_each_other_and_from_an_outlier(rng):
    hit = 0
    for _ in range(100):
        values = rng.standard_normal(200)
        values[120:] += 1.5
        changes = change_points(values)
        assert len(changes) == 1
        assert changes[0].shift == pytest.approx(1.5, abs=5.0 * changes[0].error)
        hit += changes[0].low <= 120 <= changes[0].high
    assert hit >= 90
    values = rng.standard_normal(300)
    values[100:] += 3.0
    values[200:] -= 3.0
    values[50] += 15.0
    assert [round(change.first, -1) for change in change_points(values)] == [100, 200]
    assert noise_of(values) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(("memory", "dof"), KINDS, ids=NAMES)
@pytest.mark.parametrize("n", mostly_slow([20, 40, 100], 20))
def test_a_series_that_stands_still_changes_as_seldom_as_is_said(n: int, memory: float, dof: float | None) -> None:
    rng = np.random.default_rng([20_261_122, n])
    series = made.autoregressive(rng, 300, n, memory, dof=dof)
    p = np.array([min((one.p_value for one in change_points(values, 1e-2)), default=1.0) for values in series])
    assert np.sum(p < 1e-2) <= 8  # 3 are expected; under 0.6 there were 9 in 20 points, and of them 3 below 1e-3
    assert np.sum(p < 1e-3) <= 2


@each([(40, 20, 0.0, 4.0, 0.85), (100, 50, 0.0, 2.0, 0.9), (120, 70, 0.0, 2.5, 0.85), (120, 70, 0.6, 6.0, 0.85)])
def test_a_step_is_told_where_it_is(row: tuple[int, int, float, float, float]) -> None:
    n, at, memory, size, least = row
    moved = made.autoregressive(np.random.default_rng(20_261_124), 40, n, memory) + size * (np.arange(n) >= at)
    assert np.mean([any(abs(c.first - at) <= 3 for c in change_points(one)) for one in moved]) >= least


def test_a_series_with_a_gap_or_a_wild_first_value_has_no_change() -> None:
    assert change_points(np.array([1.0, np.nan] * 20)) == []
    values = np.random.default_rng(20_261_123).standard_normal(60)
    values[0], values[-1] = 60.0, -60.0
    assert np.max(np.abs(drawn_in(values))) < 6.0
    assert change_points(values, 1e-2) == []
