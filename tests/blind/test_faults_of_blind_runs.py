"""Injected faults touch the unit they say, and no other."""

import numpy as np
import pytest
from truth import Spec, make_run
from truth.scenarios import FAULT_NAMES


def pair(fault, seed=3):
    plain = {"plan": "twenty_six", "soaks": "five", "units": 5, "device": "counts"}
    return make_run(Spec(faults=(fault,), **plain), seed), make_run(Spec(**plain), seed)


@pytest.mark.parametrize("fault", FAULT_NAMES)
def test_fault_changes_its_own_unit_only(fault):
    run, clean = pair(fault)
    (truth,) = run.sealed.faults
    assert truth.fault == fault
    assert fault in truth.accepted
    for unit, rows in clean.dwells.groupby("unit"):
        same = run.dwells[run.dwells["unit"] == unit].reset_index(drop=True).equals(rows.reset_index(drop=True))
        assert same == (unit not in truth.units)


@pytest.mark.parametrize("fault", FAULT_NAMES)
def test_fresh_run_is_clean(fault):
    run, clean = pair(fault)
    assert run.fresh.equals(clean.fresh)


def test_swapped_dwells_are_far_apart():
    run, clean = pair("swapped_dwells")
    gap = np.abs(run.dwells["out_x"] - clean.dwells["out_x"]) + np.abs(run.dwells["out_z"] - clean.dwells["out_z"])
    assert np.count_nonzero(gap) == 2


def test_stuck_output_repeats_and_has_no_scatter():
    run, _ = pair("stuck_output")
    (truth,) = run.sealed.faults
    held = run.dwells[(run.dwells["unit"] == truth.units[0]) & run.dwells["dwell"].isin(truth.dwells)]
    assert held["out_x"].nunique() == 1
    assert (held["sd_x"] == 0.0).all()
