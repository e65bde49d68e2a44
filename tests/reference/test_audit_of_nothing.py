"""What the audit says of archives in which nothing happens: shares of false findings, on histories from plain arithmetic."""

import independent_noise as made
import numpy as np
import pytest
from long_suites import mostly_slow

from inertial.population.change_points import change_points
from inertial.population.control_charts import alarms, baseline, false_alarms, signals
from pipelines.audit.calibrations import Calibrations
from pipelines.audit.drifts import OF_UNIT, kind_drifts
from pipelines.audit.exchanged_serials import strangers
from pipelines.audit.parameters import NAMES
from pipelines.audit.population import Figures, abilities, odd_ones
from pipelines.audit.rules import load_rules
from pipelines.audit.unit_drifts import unit_drifts

DEVICE, YEAR_D = "adxl355", 365.25
# bias µg, scale ppm, square mrad, rotation mrad, bias over temperature µg/K, scale over temperature ppm/K; each thrice
BETWEEN = np.repeat([8000.0, 3000.0, 3.0, 1.0, 50.0, 200.0], 3)
REPEAT = np.repeat([60.0, 60.0, 0.03, 0.05, 1.0, 1.5], 3)
A_YEAR = np.repeat([250.0, 120.0, 0.02, 0.0, 2.0, 3.0], 3)


def calibrations(serials, days, values, *, stations=None, slots=None, runs=None, errors=REPEAT):
    serials, days, values = np.asarray(serials, dtype=object), np.asarray(days, dtype=float), np.asarray(values)
    order = np.lexsort((days, serials.astype(str)))
    n = len(order)
    same = np.full(n, "line-1", dtype=object)
    return Calibrations(
        run=np.array([f"r{k:06d}" for k in range(n)] if runs is None else runs, dtype=object)[order],
        unit=serials[order],
        device=np.full(n, DEVICE, dtype=object),
        station=(same if stations is None else np.asarray(stations, dtype=object))[order],
        slot=(np.zeros(n, dtype=np.int64) if slots is None else np.asarray(slots, dtype=np.int64))[order],
        outcome=np.full(n, "pass", dtype=object),
        day=days[order],
        values=values[order],
        errors=np.broadcast_to(errors, values.shape)[order],
    )


def named(units, times=1):
    return np.repeat([f"U{u:05d}" for u in range(units)], times)


def disagreeing(histories):
    """The share of calibrations that disagree with the one before, by figure."""
    return [one.beyond for one in kind_drifts(histories, np.ones(len(histories), dtype=bool), load_rules(), 0.0)]


def yearly(rng, units, years=2.0, times=2):
    base, slope = (sd * rng.standard_normal((units, 1, len(NAMES))) for sd in (BETWEEN, A_YEAR))
    t = years * np.arange(times)
    values = base + slope * t[:, None] + REPEAT * rng.standard_normal((units, times, len(NAMES)))
    days = 200.0 + 0.5 * np.arange(units)[:, None] + YEAR_D * t
    serials = named(units, times)
    return serials, days.ravel(), values.reshape(-1, len(NAMES))


def weekly(rng, standards, weeks=100):
    values = BETWEEN * rng.standard_normal((standards, 1, len(NAMES)))
    values = values + REPEAT * rng.standard_normal((standards, weeks, len(NAMES)))
    days = np.tile(200.0 + 7.0 * np.arange(weeks), standards)
    return np.repeat([f"CS-{s}" for s in range(standards)], weeks), days, values.reshape(-1, len(NAMES))


def joined(*parts):
    return (np.concatenate(own) for own in zip(*parts, strict=True))


def test_two_years_of_drift_beside_weekly_standards_make_no_strangers(rng):
    assert strangers(calibrations(*joined(yearly(rng, 300), weekly(rng, 4)))) == []


def test_exchanged_serials_are_found_beside_weekly_standards(rng):
    serials, days, values = yearly(rng, 300)
    values[[1, 3]] = values[[3, 1]]
    histories = calibrations(*joined((serials, days, values), weekly(rng, 4)))
    told = sorted((histories.unit[s.row], s.looks_like, s.exchanged) for s in strangers(histories))
    assert told == [("U00000", "U00001", True), ("U00001", "U00000", True)]


@pytest.mark.parametrize("ratio", [8.0, 20.0])
def test_a_broken_unit_among_many_alike_is_not_taken_for_another(rng, ratio):
    wrong = 0
    for _ in range(6):
        values = np.zeros((2000, 2, len(NAMES)))
        values[..., :3] = ratio * 60.0 * rng.standard_normal((2000, 1, 3)) + 60.0 * rng.standard_normal((2000, 2, 3))
        values[100, 1, :3] += 60.0 * ratio * rng.choice([-1.5, 1.5], 3)
        days = np.tile([200.0, 565.0], 2000)
        histories = calibrations(named(2000, 2), days, values.reshape(-1, len(NAMES)))
        strange = [s for s in strangers(histories) if histories.unit[s.row] == "U00100"]
        wrong += any(s.looks_like for s in strange)
    assert wrong <= 2


TOLERANCE = np.repeat([1500.0, 1000.0, 1.0, 1.0, 60.0, 60.0], 3)


@pytest.mark.parametrize(("slope", "walk"), [(0.25, 0.0), (0.0, 0.3), (0.15, 0.2)], ids=["slope", "walk", "both"])
@pytest.mark.parametrize("times", mostly_slow([2, 4], 2))
def test_units_are_in_tolerance_when_their_reliability_ends(rng, slope, walk, times):
    units, seating = 300, 0.05
    slopes = slope * rng.standard_normal((units, 1, len(NAMES)))
    steps = walk * rng.standard_normal((units, times, len(NAMES))) * (np.arange(times) > 0)[:, None]
    level = slopes * np.arange(times)[:, None] + np.cumsum(steps, axis=1)
    values = TOLERANCE * (level + np.hypot(seating, seating) * rng.standard_normal(level.shape))
    serials = named(units, times)
    days = np.tile(200.0 + YEAR_D * np.arange(times), units)
    histories = calibrations(serials, days, values.reshape(-1, len(NAMES)), errors=seating * TOLERANCE)
    every, rules = np.ones(len(histories), dtype=bool), load_rules()
    drifts = unit_drifts(histories, every, kind_drifts(histories, every, rules, 0.0), rules, {})
    last = {d.unit: d.reliable_day for own in drifts.values() for d in own}
    ahead = (np.array([last[f"U{u:05d}"] for u in range(units)]) - days[-1]) / YEAR_D
    walked = walk * np.sqrt(ahead)[:, None] * rng.standard_normal((units, len(NAMES)))
    then = level[:, -1] + slopes[:, 0] * ahead[:, None] + walked
    off = np.abs(then - values[:, -1] / TOLERANCE)[:, [NAMES.index(name) for name in OF_UNIT]]
    assert np.mean(np.all(off <= 1.0, axis=1)) > 0.92
    assert np.median(ahead) > 0.5


@pytest.mark.parametrize("stated", [1.0, 0.2], ids=["stated rightly", "stated as a fifth"])
def test_units_that_stand_still_agree_in_nineteen_of_twenty(rng, stated):
    beyond = []
    for _ in range(8):
        units, times = 20, 3
        values = REPEAT * rng.standard_normal((units * times, len(NAMES)))
        days = np.cumsum(rng.uniform(100.0, 300.0, (units, times)), axis=1).ravel()
        beyond += disagreeing(calibrations(named(units, times), days, values, errors=stated * REPEAT))
    assert len(beyond) == 8 * len(OF_UNIT)
    assert np.mean(beyond) < 0.062


@pytest.mark.parametrize("units", [8, 60])
@pytest.mark.parametrize("kind", mostly_slow(["white", "correlated", "flicker"], "correlated"))
def test_second_calibrations_agree_in_nineteen_of_twenty(rng, kind, units):
    beyond = []
    for _ in range(6):
        days = np.cumsum(rng.uniform(100.0, 300.0, (units, 2)), axis=1)
        rows = units * len(NAMES)
        if kind == "flicker":
            series = made.flicker(rng, rows, 512, 1.0).reshape(units, len(NAMES), 512)
            later = (days[:, 1] - days[:, 0]).astype(int)
            pair = np.stack([series[..., 0], series[np.arange(units), :, later]], axis=1)
        else:
            memory = 0.6 if kind == "correlated" else 0.0
            pair = np.swapaxes(made.autoregressive(rng, rows, 2, memory).reshape(units, len(NAMES), 2), 1, 2)
        values = (REPEAT * pair).reshape(-1, len(NAMES))
        beyond += disagreeing(calibrations(named(units, 2), days.ravel(), values, errors=0.2 * REPEAT))
    assert len(beyond) == 6 * len(OF_UNIT)
    assert np.mean(beyond) < 0.065


def test_units_that_wander_disagree_all_the_same(rng):
    units, times = 60, 4
    days = np.cumsum(rng.uniform(100.0, 600.0, (units, times)), axis=1)
    steps = np.sqrt(np.diff(days, axis=1, prepend=days[:, :1]) / 200.0)[..., None]
    values = np.cumsum(steps * REPEAT * rng.standard_normal((units, times, len(NAMES))), axis=1)
    values = values.reshape(-1, len(NAMES))
    histories = calibrations(named(units, times), days.ravel(), values, errors=0.2 * REPEAT)
    assert np.mean(disagreeing(histories)) > 0.3


FIGURES, LIMIT = 7, 4.0  # as many figures, normal with σ = 1 and limits of ± 4: Ppk is 4/3


def told_different(every, columns):
    """Whether stations or slots are said to differ (p below 10⁻³, 2 % of the variance), and the share of Ppk that hold."""
    n = len(every)
    names = np.repeat(np.array([f"figure_{k}" for k in range(len(columns))], dtype=object), n)
    texts = np.full(names.size, "1", dtype=object)
    rows = np.tile(np.arange(n), len(columns))
    figures = Figures(rows, names, np.concatenate(columns), np.full(names.size, LIMIT), texts)
    able, differences = abilities(every, figures)
    held = np.mean([one.ppk.low <= LIMIT / 3.0 <= one.ppk.high for one in able])
    return any(one.by != "lot" and one.p < 1e-3 and one.comparison.effect > 0.02 for one in differences), held


def test_units_that_come_back_to_their_station_are_no_evidence_against_it(rng):
    wrong, held, units, times = 0, [], 60, 5
    serials, days, nothing = named(units, times), np.tile(180.0 * np.arange(times), units), np.zeros((300, len(NAMES)))
    for _ in range(25):
        seat = np.repeat(rng.integers(0, 24, units), times)
        every = calibrations(serials, days, nothing, stations=[f"line-{one}" for one in seat // 8], slots=seat % 8)
        own = [np.repeat(rng.standard_normal(units), times) + 0.05 * rng.standard_normal(300) for _ in range(FIGURES)]
        told, share = told_different(every, own)
        wrong, held = wrong + told, [*held, share]
    assert wrong <= 1
    assert np.mean(held) == pytest.approx(0.95, abs=0.05)


@pytest.mark.slow
def test_lots_that_differ_are_no_evidence_against_their_stations(rng):
    wrong, held, lots, size = 0, [], 30, 8
    lot, slots = np.repeat(np.arange(lots), size), np.tile(np.arange(size), lots)
    serials, nothing, runs = named(lot.size), np.zeros((lot.size, len(NAMES))), [f"r{one:03d}" for one in lot]
    for _ in range(25):
        stations = np.array([f"line-{one}" for one in rng.integers(0, 3, lots)])[lot]
        every = calibrations(serials, lot, nothing, stations=stations, slots=slots, runs=runs)
        own = [(rng.standard_normal(lot.size) + rng.standard_normal(lots)[lot]) / np.sqrt(2.0) for _ in range(FIGURES)]
        told, share = told_different(every, own)
        wrong, held = wrong + told, [*held, share]
    assert wrong <= 1
    assert np.mean(held) == pytest.approx(0.94, abs=0.05)


@pytest.mark.parametrize("differing", [0.0, 1.0])
def test_large_lots_stand_out_no_more_than_small_ones(rng, differing):
    odd_lots = 0
    for _ in range(4):
        lot = np.repeat(np.arange(150), rng.choice([4, 8, 32], 150, p=[0.2, 0.6, 0.2]))
        values = rng.standard_normal((lot.size, len(NAMES))) + differing * rng.standard_normal((150, len(NAMES)))[lot]
        every = calibrations(named(lot.size), lot, values, runs=[f"r{one:03d}" for one in lot])
        odd_lots += sum(odd.kind == "lot" for odd in odd_ones(every, np.ones(len(every), dtype=bool)))
    assert odd_lots <= 1


@pytest.mark.slow
@pytest.mark.parametrize(("n", "counted"), mostly_slow([(60, 20), (200, 160)], (60, 20)))
def test_charts_in_control_are_found_out_of_it_as_rarely_as_is_said(rng, n, counted):
    chance, which = false_alarms(n, 40, counted), np.arange(n) >= n - counted
    p_values = []
    for values in rng.standard_normal((2000, n)):
        rules, moving = signals(values, baseline(values, 40))
        p_values.append(chance.p_value(alarms(rules, moving.outside, which)))
    assert np.mean(np.array(p_values) < 0.01) == pytest.approx(0.01, abs=0.007)
    assert np.sum(np.array(p_values) < 0.01 / 18.0) <= 6  # 1.1 are expected
    by_number = [chance.p_value(number) for number in range(counted + 1)]
    assert by_number[0] == 1.0
    assert np.all(np.diff(by_number) <= 0.0)
    assert by_number[-1] > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("n", mostly_slow([8, 16, 60], 8))
def test_short_series_change_their_level_no_oftener_than_is_said(rng, n):
    changes = [change_points(values, 1e-2) for values in rng.standard_normal((2000, n))]
    p = np.array([min((change.p_value for change in own), default=1.0) for own in changes])
    assert np.mean(p < 1e-2) < 0.01
    assert np.sum(p < 1e-4) <= 2
