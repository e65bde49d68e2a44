"""Risks and intervals where the truth is drawn: standard deviations, lots with one reference, the worst of three axes."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from inertial.dynamics.settling import step_response
from inertial.dynamics.step_record import step_figures
from inertial.errors import NotIdentified
from inertial.population.capability import cpk, shape_of
from inertial.population.gauge import gauge_study
from inertial.uncertainty.deviation_law import DeviationLaw, dof_of_upper
from inertial.uncertainty.risk import global_risk, lot_risk
from pipelines.procedures.figures import FigureValue, worst
from pipelines.stages.bias_stability import bias_stability
from pipelines.stages.figures import UNITS
from pipelines.stages.grade import _of_procedures
from pipelines.stages.uncertainty.lot_risks import lot_risks
from schemas.decisions import decide
from schemas.limits import Limits, limits_of

TURN_ON = "turn_on_repeatability_ug"


def limited(figure: str, limit: float, rule: str = "guarded_acceptance") -> Limits:
    own = {"name": "own", "rule": rule, "figures": {figure: {"max": limit, "unit": UNITS[figure]}}}
    return limits_of(own, UNITS)


@pytest.mark.parametrize(("cycles", "removed"), [(10, 0.0), (3, 0.0), (10, 40.0)])
def test_a_deviation_at_its_limit_is_accepted_as_rarely_as_the_guard_band_says(
    cycles: int, removed: float, rng: np.random.Generator
) -> None:
    limits, n, taken, normal = limited(TURN_ON, 100.0), 4000, 0, 0
    means = np.hypot(100.0, removed) * rng.normal(size=(n, cycles))
    for s in means.std(axis=1, ddof=1):
        value = float(np.sqrt(max(s**2 - removed**2, 0.0)))
        u = s / np.sqrt(2.0 * (cycles - 1))
        taken += decide(limits, TURN_ON, value, u, DeviationLaw(value, cycles - 1.0, removed)).passed
        normal += decide(limits, TURN_ON, value, u).passed
    assert taken / n == pytest.approx(norm.cdf(-2.0), abs=0.008)
    assert normal / n > 0.07


def test_the_stated_risk_of_a_deviation_is_the_share_beyond_the_limit(rng: np.random.Generator) -> None:
    for dof in (9, 2):
        sigma = np.exp(rng.uniform(np.log(1.0), np.log(1e4), size=400_000))  # a scale that nothing is known of
        found = sigma * np.sqrt(rng.chisquare(dof, size=sigma.size) / dof)
        for value in (50.0, 68.0):
            near = np.abs(np.log(found / value)) < 0.05
            share = np.mean(sigma[near] > 100.0)
            assert DeviationLaw(value, dof).beyond(100.0) == pytest.approx(share, abs=0.02)


def test_simple_acceptance_compares_the_value_and_a_least_value_is_judged_from_below() -> None:
    law = DeviationLaw(99.0, 9.0)
    assert decide(limited(TURN_ON, 100.0, "simple_acceptance"), TURN_ON, 99.0, 23.0, law).passed
    decision = decide(limited(TURN_ON, 100.0), TURN_ON, 99.0, 23.0, law)
    assert decision.outcome == "conditional pass"
    assert "χ² with 9 degrees of freedom" in decision.rule
    assert law.quantile(0.975) == pytest.approx(1.8256 * 99.0, rel=1e-3)
    assert dof_of_upper(1.8256) == pytest.approx(9.0, rel=1e-2)
    assert np.isnan(dof_of_upper(0.9))


def test_the_table_of_a_procedure_brings_the_law_to_the_decision() -> None:
    row = {
        "unit": "A", "figure": TURN_ON, "axis": "x", "value": 60.0, "uncertainty": 14.0, "identified": True,
        "unit_text": "µg", "note": "", "dof": 9.0, "removed": 5.0,
    }  # fmt: skip
    [figure] = _of_procedures(pd.DataFrame([row]), "A", limited(TURN_ON, 100.0))
    assert figure.law == DeviationLaw(60.0, 9.0, 5.0)
    earlier = {name: value for name, value in row.items() if name not in {"dof", "removed"}}
    [figure] = _of_procedures(pd.DataFrame([earlier]), "A", limited(TURN_ON, 100.0))
    assert figure.law is None


def test_an_error_of_the_references_moves_the_whole_lot(rng: np.random.Generator) -> None:
    n = 1_000_000
    for mean, process, u, shared, accept in ((0.8, 0.0, 0.02, 0.174, 0.9), (0.5, 0.2, 0.1, 0.3, 0.8)):
        shown = mean + process * rng.normal(size=n)
        true, read = shown - shared * rng.normal(size=n), shown + u * rng.normal(size=n)
        risk = lot_risk(mean, process, u, shared, (-1.0, 1.0), (-accept, accept))
        assert risk.pfa == pytest.approx(np.mean((np.abs(true) > 1.0) & (np.abs(read) <= accept)), abs=2e-3)
        assert risk.pfr == pytest.approx(np.mean((np.abs(true) <= 1.0) & (np.abs(read) > accept)), abs=2e-3)
    alone = global_risk(0.0, 0.5, 0.25, (-1.0, 1.0), (-1.0, 1.0))
    same = lot_risk(0.0, 0.5, 0.25, 0.0, (-1.0, 1.0), (-1.0, 1.0))
    assert same.pfa == pytest.approx(alone.pfa, abs=1e-12)


def test_the_printed_risk_of_a_lot_has_the_error_of_its_references() -> None:
    figure = "bias_error_ug"
    rows = pd.DataFrame(
        {
            "figure": figure, "unit_text": "µg", "value": [799.0, 800.0, 801.0, 800.0], "uncertainty": 2.0 * 174.0,
            "limit": 1000.0, "accept": 900.0, "pfa": 0.125,
        }
    )  # fmt: skip
    [risk] = lot_risks(rows, limited(figure, 1000.0), {figure: 173.9})["pfa"]
    assert risk == pytest.approx(0.125, abs=0.005)
    [apart] = lot_risks(rows, limited(figure, 1000.0), {})["pfa"]
    assert apart < 1e-6


@pytest.mark.parametrize("means", [(0.0, 0.0, 0.0), (5.0, 5.0, 5.0), (5.0, -5.0, 4.5), (9.0, 0.0, 0.0)])
def test_the_interval_of_the_worst_axis_holds_the_largest_magnitude(
    means: tuple[float, ...], rng: np.random.Generator
) -> None:
    n, held = 3000, 0
    for one in np.array(means) + rng.normal(size=(n, 3)):
        figure = worst([FigureValue("f", axis, value, 1.0) for axis, value in zip("xyz", one, strict=True)])
        size = max(np.abs(means))
        held += any(figure.low <= true <= figure.high for true in (size, -size))
    assert held / n > 0.94


@pytest.mark.parametrize("dof", [2, 9])
def test_the_interval_of_the_worst_deviation_holds_the_largest(dof: int, rng: np.random.Generator) -> None:
    n, held = 2000, 0
    for found in np.sqrt(rng.chisquare(dof, size=(n, 3)) / dof):
        values = []
        for axis, value in zip("xyz", found.tolist(), strict=True):
            law = DeviationLaw(value, dof)
            spread = value / np.sqrt(2.0 * dof)
            values.append(FigureValue("f", axis, value, spread, law.quantile(0.025), law.quantile(0.975), dof=dof))
        figure = worst(values)
        held += figure.low <= 1.0 <= figure.high
    assert held / n > 0.94


def test_a_settling_time_near_the_edge_of_the_band_is_stated_only_where_it_is_right(rng: np.random.Generator) -> None:
    stated = wrong = 0
    for _ in range(250):
        damping, order = rng.uniform(0.15, 0.6), rng.integers(1, 4)
        size = np.exp(-np.pi * damping * order / np.sqrt(1.0 - damping**2))
        if not 0.005 < size < 0.25:
            continue
        noise, rate = size * rng.uniform(0.02, 0.12), 50e3
        band, count = size + noise * rng.uniform(-4.0, 8.0), int(rate * 4e-3 / damping)
        time = np.arange(-count // 20, count) / rate + 1e-9
        response = step_response(time, 1000.0, damping) + noise * rng.normal(size=time.size)
        fine = np.linspace(0.0, time[-1], 100_001)
        true = fine[np.flatnonzero(np.abs(step_response(fine, 1000.0, damping) - 1.0) > band)[-1]]
        try:
            figures = step_figures(time, response, np.full(time.size, noise), band=band)
        except NotIdentified:
            continue
        if figures.settling_identified:
            stated += 1
            wrong += abs(figures.settling_s - true) > 4.0 * figures.settling_error_s
    assert wrong <= 0.02 * stated
    assert stated >= 10


@pytest.mark.parametrize("n", [20, 50, 200])
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
    ("shape", "part", "station", "interaction"), [((10, 3, 3), 3.0, 1.0, 0.5), ((8, 1, 3), 3.0, 0.0, 0.0)]
)
def test_the_intervals_of_a_gauge_study_hold(
    shape: tuple[int, int, int], part: float, station: float, interaction: float, rng: np.random.Generator
) -> None:
    p, o, _ = shape
    gauge = float(np.sqrt(1.0 + station**2 + interaction**2))
    percent, held, runs = 100.0 * gauge / np.hypot(gauge, part), np.zeros(2), 300
    for _ in range(runs):
        values = part * rng.normal(size=(p, 1, 1)) + station * rng.normal(size=(1, o, 1)) + rng.normal(size=shape)
        study = gauge_study(values + interaction * rng.normal(size=(p, o, 1)))
        ends = study.gauge_interval, study.percent_interval
        held += [low <= true <= high for (low, high), true in zip(ends, (gauge, percent), strict=True)]
    assert np.all(held / runs > 0.91)


@pytest.mark.parametrize("walk", [0.0, 1.0])
def test_the_stability_of_the_static_record_has_the_freedoms_of_its_noise(
    walk: float, rng: np.random.Generator
) -> None:
    at, held, runs = np.arange(36), 0, 200
    covariance = np.eye(36) + 100.0 * walk**2 * (
        np.minimum.outer(at, at) + np.where(np.equal.outer(at, at), 1 / 3, 0.5)
    )
    true = float(np.sqrt((np.trace(covariance) - covariance.mean() * 36.0) / 35.0))
    for _ in range(runs):
        found = bias_stability(10.0 * rng.normal(size=3600) + walk * np.cumsum(rng.normal(size=3600)), 1.0)
        assert found is not None
        held += found[1] <= true <= found[2]
    assert held / runs > 0.9  # as of 36 independent means it holds in 42 % of a walk
