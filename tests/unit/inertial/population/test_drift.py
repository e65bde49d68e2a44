"""Drift of kinds and units on data whose truth is known."""

import numpy as np
import pytest

from inertial.population.drift import forecast, in_tolerance, kind_of, last_reliable, leaves, standing

SLOPE, WALK, MOUNT, SIGMA, MEAN = 60.0, 40.0, 30.0, 50.0, 10.0


def histories(rng: np.random.Generator, units: int = 800, calibrations: int = 8):
    """Units that drift as the model says: values, errors, years (units, calibrations), and level and slope at the end."""
    years = np.cumsum(rng.uniform(0.3, 0.8, (units, calibrations)), axis=1)
    slope = MEAN + SLOPE * rng.standard_normal(units)
    steps = np.sqrt(np.diff(years, axis=1, prepend=years[:, :1])) * WALK * rng.standard_normal(years.shape)
    truth = 5000.0 * rng.standard_normal((units, 1)) + slope[:, None] * years + np.cumsum(steps, axis=1)
    values = truth + np.hypot(SIGMA, MOUNT) * rng.standard_normal(years.shape)
    return values, np.full(years.shape, SIGMA), years, truth[:, -1], slope


def pairs_of(values, errors, years):
    change = [np.diff(values, axis=1).ravel(), values[:, -1] - values[:, 0]]
    time = [np.diff(years, axis=1).ravel(), years[:, -1] - years[:, 0]]
    known = np.full(sum(c.size for c in change), 2.0 * errors[0, 0] ** 2)
    return np.concatenate(change), np.concatenate(time), known


def judged(values, errors, years):
    kind = kind_of(*pairs_of(values, errors, years))
    return kind, standing(values, errors, years, kind)


def test_a_kind_s_drift_is_found_from_its_pairs(rng):
    values, errors, years, *_ = histories(rng, units=4000)
    kind = kind_of(*pairs_of(values, errors, years))
    assert kind.mean_slope == pytest.approx(MEAN, abs=4.0)
    assert kind.slope_sd == pytest.approx(SLOPE, rel=0.1)
    assert kind.walk_sd == pytest.approx(WALK, rel=0.25)
    assert kind.mount_sd == pytest.approx(MOUNT, rel=0.5)


def test_prediction_intervals_cover_what_comes(rng):
    values, errors, years, level, slope = histories(rng)
    kind, now = judged(values, errors, years)
    mean, deviation = forecast(now, kind, np.array([0.0, 2.0]), origin=0.0)
    assert np.std((mean[:, 0] - level) / deviation[:, 0]) == pytest.approx(1.0, abs=0.12)
    later = level + 2.0 * slope + np.sqrt(2.0) * WALK * rng.standard_normal(level.size)
    inside = np.abs(mean[:, 1] - later) <= 1.96 * deviation[:, 1]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


def test_histories_of_different_length_stand_beside_each_other(rng):
    values, errors, years, *_ = histories(rng, units=5)
    kind = kind_of(*pairs_of(values, errors, years))
    whole = standing(values[:1, :4], errors[:1, :4], years[:1, :4], kind)
    values[0, 4:] = np.nan
    mixed = standing(values, errors, years, kind)
    assert mixed.level[0] == pytest.approx(whole.level[0])
    assert mixed.slope_var[0] == pytest.approx(whole.slope_var[0])
    assert mixed.last[0] == values[0, 3]


def test_a_unit_unlike_its_kind_is_judged_by_its_own_history(rng):
    values, errors, years, *_ = histories(rng)
    values[0] += 900.0 * (years[0] - years[0, 0])
    _, now = judged(values, errors, years)
    assert now.slope[0] == pytest.approx(900.0, abs=200.0)
    assert np.std(now.slope[1:]) < 1.5 * SLOPE


def test_the_day_of_leaving_has_an_interval_around_it(rng):
    values, errors, years, *_ = histories(rng)
    kind, now = judged(values, errors, years)
    ahead = np.linspace(0.0, 20.0, 241)
    mean, deviation = forecast(now, kind, ahead, origin=now.last)
    expected, soonest, latest = leaves(mean, deviation, 400.0, ahead)
    finite = np.isfinite(expected)
    assert finite.sum() > 100
    assert np.all(soonest[finite] <= expected[finite])
    assert np.all(expected[finite] <= latest[finite])
    reliable = last_reliable(in_tolerance(mean, deviation, 400.0), 0.95, ahead)
    assert np.all(soonest[finite] <= reliable[finite] + 0.1)  # 2.5 % beyond one side comes before 5 % in all


def test_an_exponential_reliability_ends_where_rp_1_says():
    """NCSL RP-1: R(t) = exp(−λt) reaches the target R at t = −ln(R)/λ."""
    ahead = np.linspace(0.0, 10.0, 10001)
    assert last_reliable(np.exp(-0.05 * ahead)[None], 0.95, ahead)[0] == pytest.approx(-np.log(0.95) / 0.05, abs=2e-3)


def test_calibrations_minutes_apart_tell_no_drift() -> None:
    rng = np.random.default_rng(7_310_009)
    years = 2026.0 + np.array([0.0, 20.0]) / 60.0 / 24.0 / 365.25
    values = 5.0 * rng.standard_normal((30, 2))
    kind = kind_of(values[:, 1] - values[:, 0], np.full(30, np.ptp(years)), np.full(30, 8.0))
    assert (kind.mean_slope, kind.slope_sd, kind.walk_sd) == (0.0, 0.0, 0.0)
    assert kind.mount_sd == pytest.approx(np.sqrt(21.0), rel=0.5)
    now = standing(values, np.full((30, 2), 2.0), np.tile(years, (30, 1)), kind)
    assert np.isnan(now.odd).all()
    assert np.all(now.slope == 0.0)
