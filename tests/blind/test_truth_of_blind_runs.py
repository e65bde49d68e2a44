"""The generator does what it claims, judged with plain least squares written here."""

import json

import numpy as np
import pandas as pd
import pytest
from each import each
from truth import REGISTRY, SCENARIOS, Spec, case, make_run

CATALOGUE = [
    "second_order", "scale_asymmetry", "fourth_order", "third_order", "odd_quadratic", "bias_asymmetry",
    "fifth_order", "cross_coupling", "cross_axis_quadratic", "adc_nonlinearity", "dead_zone", "clipping",
    "bias_temperature", "bias_temperature_quadratic", "bias_temperature_cubic", "scale_temperature",
    "scale_temperature_quadratic", "misalignment_temperature", "second_order_temperature", "thermal_rate",
    "thermal_lag", "thermal_hysteresis", "thermal_kink", "warm_up", "aging_linear", "scale_aging", "aging_log",
    "step_change", "creep_after_move", "pose_hysteresis", "vibration_rectification", "supply_sensitivity",
    "magnetic", "level_error", "outer_encoder_offset", "encoder_harmonic", "axis_nonorthogonality", "backlash",
    "slot_rotation", "gravity_value",
]  # fmt: skip
EXCHANGE = {
    "unit", "dwell", "slot", "time_s", "out_x", "out_y", "out_z", "sd_x", "sd_y", "sd_z", "outer_deg",
    "inner_deg", "n", "duration_s", "unit_C", "chamber_C", "since_move_s", "since_power_s", "supply_V",
    "vibration_g", "out_unit",
}  # fmt: skip
OUTPUTS = ["out_x", "out_y", "out_z"]


def force_of(table):
    outer, inner = np.radians(table["outer_deg"]), np.radians(table["inner_deg"])
    return np.column_stack([np.sin(inner) * np.sin(outer), np.cos(inner) * np.sin(outer), np.cos(outer)])


def residuals(table, values, *, thermal):
    """What bias, scale, misalignment (and their two temperature terms, S(θ)·M) leave of `values`, per unit and axis."""
    left = []
    for rows in table.groupby("unit").indices.values():
        part, force = table.iloc[rows], force_of(table.iloc[rows])
        warmth = part["unit_C"].to_numpy() - 25.0
        for axis in range(3):
            along = force[:, axis]
            for _ in range(2 if thermal else 0):  # where the axis points, from the outputs themselves
                design = np.column_stack([np.ones(len(part)), *force.T, warmth, warmth * along])
                row = np.linalg.lstsq(design, part[OUTPUTS[axis]].to_numpy(), rcond=None)[0][1:4]
                along = force @ row / row[axis]
            columns = [np.ones(len(part)), *force.T, *([warmth, warmth * along] if thermal else [])]
            design = np.column_stack(columns)
            target = values[rows][:, axis]
            left.append(target - design @ np.linalg.lstsq(design, target, rcond=None)[0])
    return np.array(left)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_hides_physics_for_every_effect_of_the_catalogue():
    assert set(CATALOGUE) == {name for name in REGISTRY if not name.startswith("withheld:")}


@pytest.mark.parametrize(
    "effect", ["cross_coupling", "thermal_hysteresis", "creep_after_move", "backlash", "clipping", "level_error"]
)
@pytest.mark.parametrize("size", [0.5, 2.0])
def test_effect_has_the_size_that_was_asked_for(effect, size):
    plain = {"plan": "fibonacci24", "soaks": "nine", "units": 3}
    run, without = make_run(Spec(effects=(effect,), sizes=(size,), **plain), 4), make_run(Spec(**plain), 4)
    added = 1e6 * (run.dwells[OUTPUTS].to_numpy() - without.dwells[OUTPUTS].to_numpy())
    assert rms(residuals(run.dwells, added, thermal=True)) / run.sealed.floor_ug == pytest.approx(size, rel=0.01)


@pytest.mark.parametrize(("flicker", "walk"), [(0.0, 0.0), (2.0, 0.0), (0.5, 1.0)])
def test_null_run_has_the_noise_it_claims(flicker, walk):
    run = make_run(Spec(flicker=flicker, walk=walk), 8)
    left = residuals(run.dwells, 1e6 * run.dwells[OUTPUTS].to_numpy(), thermal=True)
    assert rms(left) <= run.sealed.floor_ug
    assert rms(left) > (0.96 if flicker + walk == 0.0 else 0.8) * run.sealed.floor_ug


def test_white_noise_is_known_from_the_scatter_within_the_dwells():
    run = make_run(Spec(device="counts"), 9)
    table = run.dwells
    known = table[["sd_x", "sd_y", "sd_z"]].to_numpy() / np.sqrt(table[["n"]].to_numpy()) / run.sealed.output_per_g
    assert 1e6 * rms(known) == pytest.approx(run.sealed.floor_ug, rel=0.1)


def test_strong_flicker_ties_neighbouring_dwells_together():
    run = make_run(Spec(flicker=2.0), 10)
    left = residuals(run.dwells, run.dwells[OUTPUTS].to_numpy(), thermal=True)
    assert np.mean(left[:, 1:] * left[:, :-1]) / np.mean(left**2) > 0.3


def test_same_seed_gives_the_same_run_and_another_seed_another():
    spec = Spec(effects=("third_order",), sizes=(1.0,), flicker=1.0)
    first, again, other = (make_run(spec, seed) for seed in (3, 3, 4))
    pd.testing.assert_frame_equal(first.dwells, again.dwells)
    pd.testing.assert_frame_equal(first.history, again.history)
    assert not np.allclose(first.dwells["out_x"], other.dwells["out_x"])


def test_fresh_run_has_the_same_effects_and_units_under_new_noise():
    plain = {"flicker": 1.0, "plan": "fibonacci24", "soaks": "nine"}
    run = make_run(Spec(effects=("cross_coupling",), sizes=(6.0,), **plain), 12)
    assert list(run.dwells["unit"]) == list(run.fresh["unit"])
    null = make_run(Spec(**plain), 12)
    alike = []
    for one in (run, null):
        pair = [residuals(t, t[OUTPUTS].to_numpy(), thermal=True).ravel() for t in (one.dwells, one.fresh)]
        alike.append(np.corrcoef(pair)[0, 1])
    assert alike[0] > 0.9
    assert abs(alike[1]) < 0.1


def test_measurements_hold_nothing_of_the_truth():
    spec = Spec(effects=("thermal_lag", "covariate:fan_rpm"), sizes=(2.0, 2.0), soaks="ramps", decoys=("humidity_pct",))
    run = make_run(spec, 5)
    for table in (run.dwells, run.fresh):
        assert set(table.columns) == EXCHANGE | {"humidity_pct", "fan_rpm"}
        assert not table.attrs
    assert list(run.history.columns) == ["time_s", "chamber_C", "slot", "unit", "unit_C"]


def test_invisible_effects_leave_no_trace_under_their_plan():
    for index in range(6):
        run = case("invisible", index, 2)
        (effect,) = run.sealed.effects
        assert not effect.visible
        assert effect.size < 0.05


def test_station_effect_is_the_same_in_every_unit():
    plain = {"units": 4, "device": "mems"}
    run, without = make_run(Spec(effects=("level_error",), sizes=(4.0,), **plain), 6), make_run(Spec(**plain), 6)
    added = (run.dwells[OUTPUTS] - without.dwells[OUTPUTS]).to_numpy().reshape(4, -1)
    assert np.abs(added - added.mean(axis=0)).max() < 0.02 * np.abs(added).max()


@each(SCENARIOS)
def test_every_scenario_gives_runs_with_their_truth(scenario):
    run = case(scenario, 1, 7)
    assert run.dwells[OUTPUTS].notna().all().all()
    json.dumps(run.sealed.document())
    for effect in run.sealed.effects:
        assert effect.visible == (scenario != "invisible")


def test_refuses_a_scenario_it_does_not_know_and_effects_without_sizes():
    with pytest.raises(ValueError, match="no scenario named 'lots'"):
        case("lots", 0, 0)
    with pytest.raises(ValueError, match="one size per effect"):
        Spec(effects=("third_order",))
