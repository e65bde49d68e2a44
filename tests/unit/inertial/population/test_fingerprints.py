"""Fingerprints, places and comparisons on data whose truth is known."""

import numpy as np
import pytest

from inertial.population.comparison import holm, outlier_limit, robust_z
from inertial.population.fingerprints import alike_below, change_scale, distance, foreign_above, nearest
from inertial.population.two_way import unit_and_place


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


def test_what_is_the_same_for_all_units_tells_nobody_apart(rng):
    old = 3000.0 * rng.standard_normal((300, 2))
    old[:, 1] = rng.standard_normal(300)
    scale = change_scale(old + rng.standard_normal(old.shape), old)
    assert scale.telling.tolist() == [True, False]


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


def test_a_comparison_that_could_not_be_made_spoils_no_other() -> None:
    np.testing.assert_allclose(holm(np.array([0.001, np.nan, 0.2])), [0.003, 1.0, 0.4])
