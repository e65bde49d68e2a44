"""The generator does what it claims, judged with plain least squares written here."""

import numpy as np
import pandas as pd
import pytest
from each import each
from scipy.signal import welch

from benchmarks.truth import Spec, case, make_run
from benchmarks.truth.memory import lag, play, preisach
from benchmarks.truth.noise import flicker_series
from benchmarks.truth.scenarios import FAULT_NAMES

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


@pytest.mark.slow
@each(["cross_coupling", "thermal_hysteresis", "creep_after_move", "backlash", "clipping", "level_error"])
def test_effect_has_the_size_that_was_asked_for(effect):
    plain = {"plan": "fibonacci24", "soaks": "nine", "units": 3}
    without = make_run(Spec(**plain), 4)
    for size in (0.5, 2.0):
        run = make_run(Spec(effects=(effect,), sizes=(size,), **plain), 4)
        added = 1e6 * (run.dwells[OUTPUTS].to_numpy() - without.dwells[OUTPUTS].to_numpy())
        assert rms(residuals(run.dwells, added, thermal=True)) / run.sealed.floor_ug == pytest.approx(size, rel=0.01)


@each([(0.0, 0.0), (2.0, 0.0), (0.5, 1.0)])
def test_null_run_has_the_noise_it_claims(row):
    flicker, walk = row
    run = make_run(Spec(flicker=flicker, walk=walk), 8)
    left = residuals(run.dwells, 1e6 * run.dwells[OUTPUTS].to_numpy(), thermal=True)
    assert rms(left) <= run.sealed.floor_ug
    assert rms(left) > (0.96 if flicker + walk == 0.0 else 0.8) * run.sealed.floor_ug


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


@pytest.mark.slow
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


@pytest.mark.slow
@each(FAULT_NAMES)
def test_fault_changes_its_own_unit_only_and_leaves_the_fresh_run_clean(fault):
    plain = {"plan": "twenty_six", "soaks": "five", "units": 5, "device": "counts"}
    run, clean = make_run(Spec(faults=(fault,), **plain), 3), make_run(Spec(**plain), 3)
    (truth,) = run.sealed.faults
    assert truth.fault == fault
    assert fault in truth.accepted
    for unit, rows in clean.dwells.groupby("unit"):
        of_unit = run.dwells[run.dwells["unit"] == unit].reset_index(drop=True)
        assert of_unit.equals(rows.reset_index(drop=True)) == (unit not in truth.units)
    assert run.fresh.equals(clean.fresh)
    held = run.dwells[(run.dwells["unit"] == truth.units[0]) & run.dwells["dwell"].isin(truth.dwells)]
    if fault == "stuck_output":
        assert (held["out_x"].nunique(), set(held["sd_x"])) == (1, {0.0})
    if fault == "swapped_dwells":
        gap = (run.dwells[OUTPUTS] - clean.dwells[OUTPUTS]).abs().sum(axis=1)
        assert np.count_nonzero(gap) == 2


# -- operators with memory, geometry and noise ---------------------------------------------------------------------------


def test_lag_play_and_relays_remember_as_their_physics_says():
    ramp = np.arange(4000.0) * 5.0
    assert (ramp - lag(ramp, 120.0, 5.0))[-1] == pytest.approx(120.0, rel=0.03)
    way = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.3, 50)])
    assert play(way, 0.1)[[49, -1]] == pytest.approx([0.9, 0.4])
    up = np.linspace(-1.0, 1.0, 200)
    out = preisach(np.concatenate([up, up[::-1], up])[None], -0.95, 0.95)[0]
    assert out[200] == pytest.approx(out[-1])  # the loop closes
    assert out[300] - out[500] > 0.2  # and has an area


@each([True, False])
def test_flicker_has_a_spectrum_that_falls_as_one_over_f(fractional):
    series = flicker_series(np.random.default_rng(1), 64, 4096, fractional=fractional)
    frequency, power = welch(series, nperseg=2048)
    band = (frequency > 0.004) & (frequency < 0.1)
    slope = np.polyfit(np.log(frequency[band]), np.log(power.mean(axis=0)[band]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.1)
