"""The error that a grade rests on: its bound and its probability, against draws of another kind and units that are used again."""

import numpy as np
import pytest

from benchmarks.budget import PRESETS
from benchmarks.budget_lots import LOT, plan_of
from benchmarks.exceedance import used_again
from inertial.uncertainty.period import Windows
from pipelines.stages.uncertainty.period_error import AxisErrors, largest_error, walk_carried
from schemas.decisions import GRADES, decide, exceedance
from schemas.limits import parse_limits
from stations.plant.preset import load_preset

LIMITS = parse_limits(
    'name = "p"\n[figures]\nbias_error_period_ug = { max = 100.0, unit = "µg" }\n',
    "limits p",
    {"bias_error_period_ug": "µg"},
)


def axis(run: float, expected: float, mean: float, fixed: float, form: np.ndarray, **later: float) -> AxisErrors:
    one = (np.array([value]) for value in (run, expected, 8.0, mean, fixed))
    return AxisErrors(*one, form, {name: np.array([value]) for name, value in later.items()})


def test_the_bound_of_the_largest_axis_is_that_of_plain_draws_of_every_error() -> None:
    """Poses, influences, noise and changes are drawn one by one here, and the RMS is taken over the poses."""
    rng = np.random.default_rng(11)
    poses, count = 8, 60_000
    force = np.tile([1.0, -1.0], poses // 2)  # along the axis: a change of scale is ± over the poses
    columns = rng.normal(size=(3, poses, 5)) * [30.0, 10.0, 10.0, 5.0, 5.0]
    shared = rng.standard_normal((count, 5))
    largest, axes = np.zeros(count), []
    for a in range(3):
        left = 20.0 + 5.0 * force
        noise = 15.0 * rng.standard_normal((count, poses))
        bias = 40.0 * rng.standard_normal((count, 1)) + 25.0 * rng.standard_normal((count, 1))
        scale = 12.0 * rng.standard_normal((count, 1)) * force
        error = left + noise + bias + scale + shared @ columns[a].T
        largest = np.maximum(largest, np.sqrt(np.mean(error**2, axis=1)))
        form = columns[a].T @ columns[a]
        run, fixed = np.sqrt(np.mean(left**2) + 15.0**2), np.sqrt(np.trace(form) / poses)
        mean = 20.0 * run / np.sqrt(np.mean(left**2))
        axes.append(axis(run, 15.0, mean, fixed, form, flicker=40.0, switch_on=25.0, switch_on_scale=12.0))
    median, bound = (float(part[0]) for part in largest_error(axes, 1e6))
    assert median == pytest.approx(np.quantile(largest, 0.5), rel=0.03)
    assert bound == pytest.approx(np.quantile(largest, 0.95), rel=0.04)
    for limit in (1.1, 1.25, 1.5):
        met = float(np.mean(largest > limit * bound))
        assert met <= exceedance(median, bound, limit * bound) + 0.003


def test_a_scatter_of_switching_on_known_from_few_cycles_widens_the_bound() -> None:
    axes = [axis(5.0, 5.0, 0.0, 0.0, np.zeros((1, 1)), switch_on=50.0)] * 3
    (_, many), (_, few) = largest_error(axes, 1e6), largest_error(axes, 3.0)
    assert few[0] > 1.3 * many[0]


def test_the_bound_decides_and_the_risk_is_that_of_the_error_not_of_its_rms() -> None:
    inside, outside = (decide(LIMITS, "bias_error_period_ug", bound, 0.0, median=60.0) for bound in (99.0, 101.0))
    assert (inside.outcome, outside.outcome) == ("pass", "fail")
    assert inside.risk == pytest.approx(0.048, abs=0.003)
    assert exceedance(60.0, 100.0, 100.0) == pytest.approx(0.05)
    assert exceedance(60.0, 100.0, 60.0) == pytest.approx(0.5)


def test_a_walk_is_carried_on_as_long_as_changes_are_known_to_go_on() -> None:
    year, run = 31_557_600.0, 9000.0
    assert walk_carried(Windows(run, 10.0, year), None) == pytest.approx(np.sqrt(6000.0))
    assert walk_carried(Windows(run, 10.0, year), 20_000.0) == pytest.approx(np.sqrt(20_000.0))
    assert walk_carried(Windows(run, 10.0, 100.0), 20_000.0) == pytest.approx(np.sqrt(3000.0 + 100.0 + 10.0 / 3.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "units"), [("sf1500", 24), *((name, units) for name in PRESETS for units in (48, 504))]
)
def test_units_used_again_exceed_their_limits_no_more_often_than_stated(name: str, units: int) -> None:
    plan, preset, rng = plan_of("24 directions × 3"), load_preset(name), np.random.default_rng([77, units])
    lots = [used_again(plan, preset, rng) for _ in range(units // LOT)]
    median, bound, met = (np.concatenate([getattr(lot, part) for lot in lots]) for part in ("median", "bound", "met"))
    spread = np.sqrt(0.05 * 0.95 * LOT / units)  # the errors of the station are those of a lot
    assert np.mean(met > bound) <= 0.05 + 2.0 * spread
    for limit in GRADES.values():
        stated = [exceedance(m, b, limit) for m, b in zip(median, bound, strict=True)]
        assert np.mean(met > limit) <= np.mean(stated) + 2.0 * np.sqrt(np.mean(stated) * LOT / units) * 0.5
