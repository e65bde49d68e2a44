"""Parts of the audit on calibrations whose truth is known: charts, slots, gauge studies, intervals, strangers."""

import numpy as np
import pytest
from calibration_rows import calibrations

from pipelines.audit.calibrations import Calibrations, day_of
from pipelines.audit.drifts import kind_drifts
from pipelines.audit.due import due
from pipelines.audit.gauge_mounts import studies
from pipelines.audit.parameters import NAMES, parameters_of
from pipelines.audit.population import odd_ones, yields
from pipelines.audit.rules import load_rules
from pipelines.audit.stations_over_time import charts, slot_series
from pipelines.audit.unit_drifts import unit_drifts

START = day_of("2022-01-03")
ERROR = 0.02


def histories_of(rows: list[tuple], values: np.ndarray) -> Calibrations:
    """Calibrations of (unit, station, slot, day after the start); every run is a day on a station."""
    days = [(unit, station, START + day) for unit, station, _, day in rows]
    return calibrations(days, values, slot=[row[2] for row in rows], errors=ERROR)


def units_again(rng: np.random.Generator, units: int = 60, times: int = 6, spread: float = 1.0):
    """Units that come back to any slot of two stations, each with parameters of its own and noise of ``ERROR``."""
    rows, values = [], []
    own = spread * rng.standard_normal((units, len(NAMES)))
    for u in range(units):
        for t in range(times):
            rows.append((f"U{u:03d}", f"line-{rng.integers(1, 3)}", int(rng.integers(0, 4)), 180.0 * t + 0.01 * u))
            values.append(own[u] + ERROR * rng.standard_normal(len(NAMES)))
    return rows, np.array(values)


def coded(texts: list[str]) -> tuple[list[str], np.ndarray]:
    known, numbers = np.unique(texts, return_inverse=True)
    return known.tolist(), numbers


def everything(histories: Calibrations) -> np.ndarray:
    return np.ones(len(histories), dtype=bool)


def test_a_check_standard_that_moves_is_out_of_control_and_one_that_stands_is_not(rng):
    rows, values = [], []
    for station in ("line-1", "line-2"):
        for week in range(150):
            rows.append((f"CS-{station}", station, 3, 7.0 * week))
            values.append(rng.standard_normal(len(NAMES)))
            if station == "line-2" and week >= 100:
                values[-1][NAMES.index("bias_x")] += 2.0
    control_charts = charts(histories_of(rows, np.array(values)), load_rules(), START)
    out = [(chart.station, chart.parameter) for chart in control_charts if not chart.in_control]
    assert out == [("line-2", "bias_x")]
    chart = next(c for c in control_charts if c.station == "line-2" and c.parameter == "bias_x")
    first = chart.day[np.argmax(chart.outside)]
    assert START + 7.0 * 98 <= first <= START + 7.0 * 112
    assert len(control_charts) == 2 * 15  # the turn belongs to the seat and is not charted


def test_a_slot_that_is_knocked_is_told_with_its_day(rng):
    rows, values = units_again(rng, units=80, times=8)
    turn = NAMES.index("rotation_z")
    for k, (_, station, slot, day) in enumerate(rows):
        if (station, slot) == ("line-2", 1) and day >= 700.0:
            values[k, turn] += 1.0
    histories = histories_of(rows, values)
    series, means = slot_series(histories, everything(histories))
    moved = [(s.station, s.where, s.parameter) for s in series if s.changes]
    assert moved == [("line-2", "slot 1", "rotation_z")]
    [change] = next(s for s in series if s.changes).changes
    assert change.shift == pytest.approx(1000.0, abs=100.0)
    assert len(means) == 8


def test_a_gauge_study_is_found_among_the_runs(rng):
    rows, values = units_again(rng, units=20, times=2)
    own = rng.standard_normal((10, len(NAMES)))
    for station, offset in (("line-1", 0.0), ("line-2", 0.3)):
        for mount in range(3):
            for part in range(10):
                rows.append((f"G{part}", station, part % 4, 500.0 + mount + 0.5 * (station == "line-2")))
                values = np.vstack([values, own[part] + offset + 0.1 * rng.standard_normal(len(NAMES))])
    histories = histories_of(rows, values)
    all_ = studies(histories, everything(histories), load_rules())
    assert {(s.stations, s.gauge.parts, s.gauge.mounts) for s in all_} == {(("line-1", "line-2"), 10, 3)}
    assert np.median([s.gauge.repeatability for s in all_]) == pytest.approx(0.1, rel=0.15)
    assert np.median([s.gauge.reproducibility for s in all_]) == pytest.approx(0.3 / np.sqrt(2.0), rel=0.3)


def test_a_unit_that_drifts_is_due_earlier_when_drift_decides(rng):
    rows, values = units_again(rng, units=80, times=6, spread=1000.0)
    bias = NAMES.index("bias_x")
    values[:, bias] += 20.0 * rng.standard_normal(len(values))
    for k, (unit, *_, day) in enumerate(rows):
        if unit == "U007":
            values[k, bias] += 1500.0 * day / 365.25
    histories = histories_of(rows, values)
    rules = load_rules().model_copy(update={"interval": "drift"})
    kinds = kind_drifts(histories, everything(histories), rules, START)
    units = unit_drifts(histories, everything(histories), kinds, rules, {("ADXL355", "bias"): 20000.0})
    answer = due(histories, everything(histories), rules, kinds, units)
    months = dict(zip(histories.unit[answer.row], answer.months, strict=True))
    assert months["U007"] < 13.0
    assert np.median(list(months.values())) == rules.longest_months
    [drift] = [d for d in units["ADXL355 U007"] if d.parameter == "bias_x"]
    assert drift.slope == pytest.approx(1500.0, abs=100.0)
    assert drift.soonest <= drift.leaves <= drift.latest
    assert drift.leaves == pytest.approx(drift.day + 365.25, abs=60.0)
    assert drift.limit_day[1] <= drift.limit_day[0] <= drift.limit_day[2]


def test_a_lot_that_stands_out_is_told_once_and_not_unit_by_unit(rng):
    rows, values = [], []
    for lot in range(60):
        for place in range(10):
            rows.append((f"L{lot:02d}-{place}", "line-1", place, float(lot)))
            values.append(rng.standard_normal(len(NAMES)) + (6.0 if lot == 33 else 0.0))
    values[205][NAMES.index("scale_y")] = 15.0
    histories = histories_of(rows, np.array(values))
    odd = odd_ones(histories, everything(histories))
    assert [(one.kind, one.name) for one in odd] == [("lot", f"line-1-{START + 33.0:.3f}"), ("unit", "L20-5")]
    assert next(one for one in yields(histories, everything(histories)) if one.of == "all").passed == 600


def test_parameters_come_from_coefficients_by_their_definitions():
    rows = [("scale", "K1", a, 2.0) for a in "xyz"] + [("bias", "K0", a, 1.5 + 0.002) for a in "xyz"]
    rows += [("misalignment", "Kxy", "x", 0.004), ("misalignment", "Kyx", "y", 0.002)]
    texts = {name: coded([r[k] for r in rows]) for k, name in enumerate(("effect", "name", "axis"))}
    value, error = np.array([r[3] for r in rows]), np.full(len(rows), 2e-6)
    parameters = parameters_of(np.zeros(len(rows), dtype=np.int64), texts, value, error, np.array([1.5]))
    assert parameters["bias_x"][0] == pytest.approx(1000.0)  # µg
    assert parameters["bias_x_error"][0] == pytest.approx(1.0)
    assert parameters["square_xy"][0] == pytest.approx(3.0)  # mrad
    assert parameters["rotation_z"][0] == pytest.approx(-0.5)
    assert np.isnan(parameters["bias_temperature_x"][0])
