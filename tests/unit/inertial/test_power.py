"""Devices switched off and on in the eyes of the science: what begins again, what goes on, and what a jump may not mean."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from each import each
from inquiries import job_of
from long_suites import mostly_slow

from inertial import effects as catalogue
from inertial.criticism.diagnosis import diagnose
from inertial.estimation.problem import Lot
from inertial.frames import force_from_angles
from inertial.next_measurement.menus import TableReach, courses
from inertial.next_measurement.proposals import Proposal
from inertial.planning.drivers import drivers_of
from inertial.planning.reasons import begins_again
from inertial.planning.sequences import SequenceStep, StationPace, extended
from inertial.power import coldness, switched
from inertial.state import History, State
from pipelines.inquiry.explanation import what
from pipelines.inquiry.followup import circumstances, follow_up, state_after, station_minutes

UP, DOWN = (0.0, 0.0), (math.pi, 0.0)


def run_of(count: int = 40, units: int = 3, *, powered: float = 900.0) -> State:
    """Poses all over the sphere at 25 °C, a dwell every 20 s, the devices on since ``powered`` s before the first."""
    rng = np.random.default_rng(4)
    outer, inner = rng.uniform(-3.0, 3.0, (2, count))
    time = np.broadcast_to(100.0 + 20.0 * np.arange(count), (units, count))
    wide = np.ones((units, count))
    return State(
        force=np.broadcast_to(force_from_angles(outer, inner), (units, count, 3)), time=time,
        temperature=25.0 * wide, chamber=25.0 * wide, since_power=time - 100.0 + powered, since_move=5.0 * wide,
        outer=outer * wide, inner=inner * wide,
    )  # fmt: skip


def switched_off(state: State, off: float, count: int = 30) -> State:
    first = SequenceStep(*UP, 25.0, off=off)
    return extended(state, [first, *(SequenceStep(*(DOWN, UP)[k % 2], 25.0) for k in range(count - 1))])


# how cold a device was when it was switched on again depends on all cycles before, in their order: no warm-up after a cycle
@each([*product(("warm_up", "aging_log"), (True, False), (None,)), ("aging_log", True, 300.0)])
def test_time_is_counted_from_the_first_dwell_in_whatever_order_dwells_are_given(row):
    name, powered, off = row
    # it had been counted from the dwell given first: below zero for all others, where a logarithm has no value
    state = run_of() if off is None else switched_off(run_of(), off)
    state = replace(state, time=state.time + 40.0 * np.arange(3)[:, None])
    if not powered:
        state = replace(state, since_power=None, power_off=None)
    turned = {k: getattr(state, k)[:, ::-1] for k in ("time", "since_power", "force") if getattr(state, k) is not None}
    effect = catalogue.get(name)
    here = effect.columns(state, 0, tau=500.0)
    backward = effect.columns(replace(state, **turned, memory={}), 0, tau=500.0)
    assert np.isfinite(here).all()
    assert backward[:, ::-1] == pytest.approx(here)
    assert drivers_of(state, effect) <= {"time", "since_power"}


def test_coldness_through_two_cycles_is_that_of_a_body_that_warms_and_cools():
    state = switched_off(switched_off(run_of(), 300.0), 120.0)
    tau, seconds = 400.0, 0.05
    cycles = switched(state)
    on_at = (state.time - state.since_power)[0]
    warmth, now, cold = 0.0, on_at[0], {}
    for k in cycles:
        for until, goal in ((on_at[k] - state.power_off[0, k], 1.0), (on_at[k], 0.0)):
            for _ in range(round((until - now) / seconds)):
                warmth += (goal - warmth) * seconds / tau
            now = until
        cold[k] = 1.0 - warmth
    computed = coldness(state, tau)[0]
    assert len(cycles) == 2
    assert [computed[k] for k in cycles] == pytest.approx([cold[k] for k in cycles], abs=2e-3)


def test_warm_up_begins_again_and_what_ageing_counts_from_is_asked_only_where_the_power_was_switched():
    asked = ("warm_up", "aging_log", "aging_linear", "scale")
    assert [begins_again(run_of(), name) for name in asked] == [True, False, False, False]
    ageing = catalogue.get("aging_log")
    names = [[p.name for p in ageing.parameters(s)] for s in (run_of(), switched_off(run_of(), 600.0))]
    assert names == [["tau"], ["tau", "clock"]]
    state = switched_off(run_of(), 600.0)
    on, anew = (ageing.columns(state, 0, tau=300.0, clock=c)[0, :, 0] for c in (0.0, 1.0))
    assert np.all(np.diff(on) > 0.0)
    assert anew[40] < 0.2 * anew[39]
    assert anew[:40] == pytest.approx(on[:40])


def test_steps_after_a_history_begin_when_it_ends_where_the_station_still_stands():
    run = run_of()
    later = History(np.linspace(100.0, 3000.0, 50), np.full((3, 50), 25.0))
    with_history = replace(run, history=later, memory={})
    step = [SequenceStep(*UP, 25.0)]
    standing = extended(with_history, step, StationPace(start=SequenceStep(*UP, 25.0)))
    between = extended(with_history, step)
    assert standing.time[0, -1] > 3000.0
    assert between.time[0, -1] < run.time[0, -1] + 60.0
    assert np.all(np.diff(between.history.time) > 0.0)


def diagnosed(state: State, bias: np.ndarray, rng: np.random.Generator):
    shape = (*state.time.shape, 3)
    output = state.force + bias[..., None] + 1e-6 * rng.standard_normal(shape)
    lot = Lot(state, output, np.full(shape, 1e-6), np.broadcast_to(np.eye(3), (shape[0], 3, 3)))
    return diagnose(lot, ["bias", "scale", "misalignment"], np.random.default_rng(1))


@pytest.mark.slow
def test_a_jump_of_the_bias_at_a_power_on_is_nothing_that_is_missing(rng):
    state = switched_off(run_of(), 600.0)
    jumps = 200e-6 * rng.standard_normal((3, 1)) * (np.arange(state.time.shape[-1]) >= 40)
    same = replace(state, power_off=None, memory={})
    assert [diagnosed(one, jumps, rng).adequate for one in (state, same)] == [True, False]


@pytest.mark.parametrize("truth", mostly_slow(["warm_up", "aging_log"], "warm_up"))
def test_what_happens_after_a_power_on_parts_warm_up_from_ageing(truth, rng):
    state = switched_off(run_of(powered=300.0), 900.0, 60)
    time, since = state.time, state.since_power
    warming = np.zeros(time.shape)
    # warmth by its differential equation; stress by relaxations over decades, in real time
    if truth == "warm_up":
        grid = np.arange(0.0, float(time.max() - (time - since).min()) + 1.0)
        begin = float((time - since)[0, 0])
        off = (begin + grid > 880.0 + 10.0) & (begin + grid < float((time - since)[0, -1]))
        warmth = np.zeros(grid.size)
        for k in range(1, grid.size):
            warmth[k] = warmth[k - 1] + ((0.0 if off[k] else 1.0) - warmth[k - 1]) / 1500.0
        warming = -150e-6 * np.interp(time - begin, grid, warmth)
    else:
        times = np.geomspace(200.0, 2e6, 60)
        passed = (time - time[0, 0] + 300.0)[..., None]
        warming = 60e-6 * np.log(times[1] / times[0]) * np.sum(1.0 - np.exp(-passed / times), axis=-1)
    turn_on = 100e-6 * rng.standard_normal((3, 1)) * (np.arange(time.shape[-1]) >= 40)
    assert [n.effects.ids for n in diagnosed(state, warming + turn_on, rng).named] == [(truth,)]


def test_power_is_switched_only_where_the_station_can_and_the_devices_say_since_when_they_have_it():
    run = run_of()
    best = [SequenceStep(*UP, 25.0), SequenceStep(*DOWN, 25.0)]
    kinds = [
        {c.kind for c in courses(state, TableReach(power=power), best, 25.0)}
        for state, power in ((run, True), (run, False), (replace(run, since_power=None), True))
    ]
    assert [("power" in k) for k in kinds] == [True, False, False]


def test_a_power_order_reaches_the_recipe_the_minutes_and_the_words(tmp_path):
    job = job_of(tmp_path, hardening=1e-4)
    wanted = [SequenceStep(*UP, 25.0), SequenceStep(*UP, 25.0, off=600.0), SequenceStep(*DOWN, 25.0)]
    follower = follow_up(wanted, job, job, ("first",), "why")
    assert follower.recipe.off_at(0) == [0.0, 600.0, 0.0]
    assert circumstances(job, job, 30.0).reach.power
    place = state_after(job)
    plain = [SequenceStep(*UP, 25.0), SequenceStep(*UP, 25.0), SequenceStep(*DOWN, 25.0)]
    assert station_minutes(wanted, job, place) - station_minutes(plain, job, place) == pytest.approx(10.0, abs=0.02)
    both = ("warm_up", "aging_log")
    told = Proposal(1.0, 50.0, both, kinds=("power",), steps=tuple(wanted), pair=both, minutes=10.0, settled=1.0)
    assert what(run_of(), told) == "Switching the units off for 10 min: warm_up restarts, aging_log continues"
