"""The audit's statistics against published numbers."""

import numpy as np
import pytest
from scipy import stats

from inertial.population.capability import cpk, fraction_interval
from inertial.population.comparison import compare, e_n, holm, sigma_of
from inertial.population.control_charts import EWMA_WEIGHT, EWMA_WIDTH, Baseline, baseline, ewma, western_electric
from inertial.population.gauge import gauge_study

# NIST/SEMATECH e-Handbook of Statistical Methods, 6.3.2.2 (individuals) and 6.3.2.4 (EWMA)
FLOW = np.array([49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1])
EWMA_DATA = [52.0, 47.0, 53.0, 49.3, 50.1, 47.0, 51.0, 50.1, 51.2, 50.5]
EWMA_DATA += [49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1]
EWMA_PRINTED = [50.60, 49.52, 50.56, 50.18, 50.16, 49.21, 49.75, 49.85, 50.26, 50.33]
EWMA_PRINTED += [50.11, 49.36, 49.52, 50.05, 49.38, 49.92, 50.73, 51.23, 51.94, 51.99]

# AIAG Measurement Systems Analysis, 4th ed., the study of chapter III-B: 10 parts, 3 appraisers, 3 trials
A = [[0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36],
     [0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25],
     [0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31]]  # fmt: skip
B = [[0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68],
     [0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62],
     [0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50]]  # fmt: skip
C = [[0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49],
     [-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77],
     [-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16]]  # fmt: skip
STUDY = np.moveaxis(np.array([A, B, C]), -1, 0)

IN_CONTROL_RUN_LENGTH = 91.75  # points between false signals of the four rules (Champ and Woodall 1987, table 1)
EWMA_RUN_LENGTH = 500.0  # of the chart's own weight and width (Lucas and Saccucci 1990; Montgomery, table 9.11)


def test_charts_of_the_handbook():
    chart = baseline(FLOW)
    assert chart.centre == pytest.approx(50.81)
    assert chart.centre + 3.0 * chart.sigma == pytest.approx(55.8041, abs=2e-4)
    assert chart.centre - 3.0 * chart.sigma == pytest.approx(45.8159, abs=2e-4)
    chart = ewma(np.array(EWMA_DATA), Baseline(50.0, 2.0539), weight=0.3, width=3.0)
    assert chart.average == pytest.approx(EWMA_PRINTED, abs=0.011)
    assert 50.0 + chart.half_width[-1] == pytest.approx(52.5884, abs=2e-3)
    assert not chart.outside.any()


@pytest.mark.slow
def test_run_length_of_the_western_electric_rules_is_the_published_one(rng):
    signals = western_electric(rng.standard_normal(1_000_000), Baseline(0.0, 1.0))
    first_rule = np.flatnonzero(signals[0]).size
    assert 1e6 / first_rule == pytest.approx(370.4, rel=0.06)
    # run length: charts restarted after each signal, as Champ and Woodall (1987) count
    lengths, position = [], 0
    values = rng.standard_normal(600_000)
    while position + 2000 < values.size:
        alarms = np.flatnonzero(western_electric(values[position : position + 2000], Baseline(0.0, 1.0)).any(axis=0))
        if not alarms.size:
            break
        lengths.append(alarms[0] + 1)
        position += alarms[0] + 1
    assert np.mean(lengths) == pytest.approx(IN_CONTROL_RUN_LENGTH, rel=0.05)


@pytest.mark.parametrize(("width", "published"), [(EWMA_WIDTH, EWMA_RUN_LENGTH), (2.859, 370.0)])
def test_run_length_of_the_ewma_is_the_published_one(width, published):
    """Lucas and Saccucci (1990), steady limits, by the Markov chain of Brook and Evans (1972)."""
    cells = 201
    limit = width * np.sqrt(EWMA_WEIGHT / (2.0 - EWMA_WEIGHT))
    edges = np.linspace(-limit, limit, cells + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    to = stats.norm.cdf((edges[None, :] - (1.0 - EWMA_WEIGHT) * middle[:, None]) / EWMA_WEIGHT)
    lengths = np.linalg.solve(np.eye(cells) - np.diff(to, axis=1), np.ones(cells))
    assert lengths[cells // 2] == pytest.approx(published, rel=0.01)


def test_ewma_and_the_rules_agree_with_a_second_way(rng):
    values = rng.standard_normal(60) + np.where(np.arange(60) > 30, 1.5, 0.0)
    chart, path, expected = Baseline(0.0, 1.0), 0.0, []
    for value in values:
        path = 0.2 * value + 0.8 * path
        expected.append(path)
    assert ewma(values, chart).average == pytest.approx(expected)
    signals = western_electric(values, chart)
    for n in range(60):
        tail = values[max(0, n - 7) : n + 1]
        assert signals[3][n] == (tail.size == 8 and (np.all(tail > 0) or np.all(tail < 0)))
        three = values[max(0, n - 2) : n + 1]
        two_of_three = any(np.sum(s * three > 2) >= 2 and s * values[n] > 2 for s in (1, -1))
        assert signals[1][n] == two_of_three


def test_gauge_study_of_the_manual():
    study = gauge_study(STUDY)
    assert study.pooled
    assert study.interaction_p == pytest.approx(0.974, abs=0.002)  # F = 0.434
    assert study.repeatability == pytest.approx(0.199933, abs=2e-6)
    assert study.reproducibility == pytest.approx(0.226838, abs=2e-6)
    assert study.gauge == pytest.approx(0.302373, abs=2e-6)
    assert study.part == pytest.approx(1.042327, abs=2e-6)
    assert study.percent == pytest.approx(27.9, abs=0.05)
    assert study.categories == 4


@pytest.mark.slow
def test_bissell_s_interval_covers_as_it_says(rng):
    """A second way: of 4000 samples of 50 normal values the interval holds the true Cpk 95 times in a hundred."""
    truth, n = 1.2, 50
    samples = rng.standard_normal((4000, n))
    intervals = [cpk(float(x.mean()), float(x.std(ddof=1)), -3.0 * truth, 3.0 * truth + 2.0, n) for x in samples]
    inside = [one.low <= truth <= one.high for one in intervals]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)


def test_share_of_the_handbook_has_the_exact_interval():
    """e-Handbook 7.2.4.1: 4 of 20, two-sided 90 % limits 0.071354 and 0.401029; here checked at 95 % by its own definition."""
    interval = fraction_interval(4, 20)
    assert stats.binom.sf(3, 20, interval.low) == pytest.approx(0.025)
    assert stats.binom.cdf(4, 20, interval.high) == pytest.approx(0.025)
    for count, total in ((4, 20), (1, 3), (999, 1000)):
        ends = stats.beta.ppf([0.025, 0.975], [count, count + 1], [total - count + 1, total - count])
        own = fraction_interval(count, total)
        assert (own.low, own.high) == pytest.approx(ends, rel=1e-9)
    assert fraction_interval(0, 10).low == 0.0
    assert fraction_interval(10, 10).high == 1.0


def test_groups_are_compared_as_scipy_does(rng):
    values, groups = np.round(rng.standard_normal(90), 1), np.repeat([0, 1, 2], 30)
    values[groups == 2] += 0.4
    parts = [values[groups == g] for g in range(3)]
    comparison = compare(values, groups)
    assert comparison is not None
    assert comparison.f_p == pytest.approx(stats.f_oneway(*parts).pvalue)
    assert comparison.rank_p == pytest.approx(stats.kruskal(*parts).pvalue)


def test_sigma_holm_s_steps_and_e_n_are_those_of_their_formulas(rng):
    values = rng.standard_normal((40, 3))
    values[5, 1] = np.nan
    plain = np.nanmedian(np.abs(values - np.nanmedian(values, axis=0)), axis=0) / stats.norm.ppf(0.75)
    assert sigma_of(values) == pytest.approx(plain, rel=1e-12)
    # Holm (1979): the smallest times n, the next times n − 1, and never falling
    assert holm(np.array([0.01, 0.04, 0.03, 0.005])) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    # ISO/IEC 17043 B.3.1.3 with expanded uncertainties 0.3 and 0.4: 0.5 apart is exactly one
    assert e_n(np.array([10.5]), np.array([10.0]), np.array([0.15]), np.array([0.2]))[0] == pytest.approx(1.0)
    assert holm(np.array([0.001, np.nan, 0.2])) == pytest.approx([0.003, 1.0, 0.4])  # one could not be compared
    one = np.ones(1)
    for dof, factor in ((2.0, 4.53), (5.0, 2.65), (10.0, 2.28)):  # JCGM 100, table G.2, 95.45 %
        assert e_n(one, 0.0 * one, one, 0.0 * one, dof)[0] == pytest.approx(1.0 / factor, rel=2e-3)
