"""Risks and intervals where the truth is drawn: standard deviations, lots with one reference, the worst of three axes."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from inertial.uncertainty.degrees import DeviationLaw, dof_of_upper
from inertial.uncertainty.risk import lot_risk
from pipelines.procedures.figures import FigureValue, worst
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
def test_a_deviation_at_its_limit_is_accepted_as_rarely_as_the_guard_band_says(cycles, removed, rng):
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
    assert figure.of.law == DeviationLaw(60.0, 9.0, 5.0)
    earlier = {name: value for name, value in row.items() if name not in {"dof", "removed"}}
    [figure] = _of_procedures(pd.DataFrame([earlier]), "A", limited(TURN_ON, 100.0))
    assert figure.of.law is None


def test_an_error_of_the_references_moves_the_whole_lot(rng: np.random.Generator) -> None:
    n = 1_000_000
    for mean, process, u, shared, accept in ((0.8, 0.0, 0.02, 0.174, 0.9), (0.5, 0.2, 0.1, 0.3, 0.8)):
        shown = mean + process * rng.normal(size=n)
        true, read = shown - shared * rng.normal(size=n), shown + u * rng.normal(size=n)
        risk = lot_risk(mean, process, u, shared, (-1.0, 1.0), (-accept, accept))
        assert risk.pfa == pytest.approx(np.mean((np.abs(true) > 1.0) & (np.abs(read) <= accept)), abs=2e-3)
        assert risk.pfr == pytest.approx(np.mean((np.abs(true) <= 1.0) & (np.abs(read) > accept)), abs=2e-3)


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
def test_the_interval_of_the_worst_axis_holds_the_largest_magnitude(means, rng):
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
