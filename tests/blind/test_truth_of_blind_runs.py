"""The generator does what it claims, judged with plain least squares written here."""

import numpy as np
import pytest
from each import each

from benchmarks.truth import Spec, make_run
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


def test_fresh_run_has_the_same_effects_and_units_under_new_noise():
    plain = {"flicker": 1.0, "plan": "fibonacci24", "soaks": "nine"}
    run = make_run(Spec(effects=("cross_coupling",), sizes=(6.0,), **plain), 12)
    assert list(run.dwells["unit"]) == list(run.fresh["unit"])
    null = make_run(Spec(**plain), 12)
    for one, least, most in ((run, 0.9, 1.0), (null, -0.1, 0.1)):
        pair = [residuals(t, t[OUTPUTS].to_numpy(), thermal=True).ravel() for t in (one.dwells, one.fresh)]
        assert least < np.corrcoef(pair)[0, 1] < most


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
