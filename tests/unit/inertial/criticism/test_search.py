"""The forward search: effects that explain more together than jumps of single axes do."""

from dataclasses import replace

import numpy as np
import pytest
from each import each
from long_suites import mostly_slow
from made_worlds import BASE, World, lot_in, make

from benchmarks.large_lots import MODEL, many_units
from inertial.criticism.diagnosis import diagnose
from inertial.estimation.lot import Lot
from inertial.state import State
from pipelines.diagnosis.diagnose import diagnose as diagnosed


def temperature_test(bias: str, along: tuple[float, ...] = (1.0, -1.0, 0.0)) -> Lot:
    """Four devices of one axis over seven soaks: their bias follows the square of the temperature, or jumps from soak to soak.

    along : g, force along the axis, dwell after dwell
    """
    rng, warm = np.random.default_rng(1), np.repeat((-40.0, -10.0, 10.0, 25.0, 40.0, 60.0, 85.0), 6) - 25.0
    n = warm.size
    force = np.zeros((n, 3))
    force[:, 0] = np.resize(along, n)
    force[:, 2] = np.sqrt(1.0 - force[:, 0] ** 2)
    each = (4, 1)
    line, square, gain = 4e-5 * rng.normal(size=each), 4e-7 * rng.normal(1.0, 0.2, each), 3e-5 * rng.normal(size=each)
    levels = np.repeat(2e-3 * rng.normal(size=(4, 7)), 6, axis=1)
    slow = levels if bias == "jumps" else line * warm + square * warm**2
    output = slow + (1.0 + gain * warm) * force[:, 0] + 1e-4 * rng.normal(size=(4, n))
    time = 60.0 * np.arange(n) + 1800.0 * np.repeat(np.arange(7), 6)
    read = np.tile(warm + 25.0, (4, 1)) + 0.1 * rng.normal(size=(4, n))
    state = State(np.tile(force, (4, 1, 1)), np.tile(time, (4, 1)), read, axes=(0,))
    return Lot(state, output[..., None], np.full((4, n, 1), 1e-4), np.tile(np.eye(3), (4, 1, 1)))


@each(["polynomial", "jumps"])
def test_a_bias_that_follows_a_polynomial_of_the_temperature_is_no_jump_of_every_device(bias: str) -> None:
    found = diagnose(temperature_test(bias), ("bias", "scale"), np.random.default_rng(2))
    told = {name for each in (*found.handled, *found.named) for name in each.effects.ids}
    polynomial = {"bias_temperature", "bias_temperature_quadratic", "scale_temperature"}
    assert ({"bias_unsteady"} if bias == "jumps" else polynomial) <= told
    assert ("bias_unsteady" in told) is (bias == "jumps")


@each([0.0, 1.0])
def test_an_axis_that_rests_in_one_pose_has_its_bias_over_temperature_named(along: float) -> None:
    lot = temperature_test("polynomial", (along,))
    found = diagnose(lot, ("bias", "bias_temperature"), np.random.default_rng(2))
    assert [{"bias_temperature_quadratic"} <= set(named.effects.ids) for named in found.named] == [True]


ALIKE = {"quadratic": "bias_temperature_quadratic", "cubic": "third_order", "warm-up": "warm_up"}


@pytest.mark.parametrize("common", mostly_slow(ALIKE, "quadratic"))
def test_an_effect_that_many_units_have_alike_is_named_though_each_of_them_hardly_shows_it(common: str) -> None:
    """Charged for a coefficient of every unit and axis, they lost to a drift of the reference and to curves over the time."""
    found = diagnose(many_units(80, 41, common, 0.9), MODEL, np.random.default_rng(2))
    assert (found.adequate, [ALIKE[common] in named.effects.ids for named in found.named]) == (False, [True])
    assert (found.handled, found.unexplained) == ((), None)


@pytest.mark.parametrize("seed", mostly_slow([8304, 8301], 8304))
def test_what_a_sample_of_a_large_lot_takes_for_a_handling_error_is_judged_in_the_complete_lot(seed: int) -> None:
    """In two dozen of these units a step of the reference explains as much as the cubic; of 8301, at another φ of its own."""
    found = diagnose(many_units(100, seed, "cubic", 0.5), MODEL, np.random.default_rng(2))
    assert (found.handled, ["third_order" in named.effects.ids for named in found.named]) == ((), [True])


def test_rivals_are_compared_at_the_wander_of_the_one_that_stays_best() -> None:
    """A lag was ahead of this quadratic at a wander that the quadratic was not judged at; at equal wander it is behind."""
    found = diagnose(many_units(100, 8503, "quadratic", 1.0), MODEL, np.random.default_rng(2))
    assert [named.effects.ids[0] for named in found.named] == ["bias_temperature_quadratic"]


@pytest.mark.parametrize("common", mostly_slow(["poses", ""], "poses"))
def test_noise_and_poses_that_differ_alike_for_all_of_many_units_are_no_effect(common: str) -> None:
    found = diagnose(many_units(80, 43, common, 1.5), MODEL, np.random.default_rng(2))
    assert (found.adequate, found.named, found.handled) == (True, (), ())


@each(["", "radians", "one row too late", "order of rows", "the outputs do not follow the recorded poses"])
def test_poses_that_contradict_the_outputs_are_told_and_nothing_else(wrong: str) -> None:
    dwells = make(World(units=3), 5).dwells.drop(columns=["force_x", "force_y", "force_z"], errors="ignore")
    if "outputs" in wrong:  # it had been left to a probability
        dwells[["out_x", "out_y", "out_z"]] = np.random.default_rng(4).normal(0.0, 0.3, (len(dwells), 3))
    angles, order = ["outer_deg", "inner_deg"], np.random.default_rng(1).permutation(72)
    for _, rows in dwells.groupby("unit"):
        table = rows[angles].to_numpy()
        other = {"radians": np.radians(table), "one row too late": np.roll(table, 1, 0), "order of rows": table[order]}
        dwells.loc[rows.index, angles] = other.get(wrong, table)
    found = diagnosed(dwells)
    assert (found["adequate"], found["classes"], found["unexplained"]) == (not wrong, [], None)
    assert wrong in (found["reason"] or "")


def test_a_saw_tooth_of_every_unit_is_a_course_over_time_and_no_change_of_single_units() -> None:
    lot, phase = lot_in(make(World(), 7)), np.linspace(0.0, 0.9, 8)[:, None, None]
    saw = 4e-4 * ((lot.state.time[..., None] / 2500.0 + phase) % 1.0 - 0.5)
    found = diagnose(replace(lot, output=lot.output + saw), BASE, np.random.default_rng(2))
    assert (found.adequate, found.handled, found.named, found.removed) == (False, (), (), ())
    assert found.unexplained is not None
    assert found.unexplained.driver == "time_s"


@each(["telegraph", "walk"])
def test_a_bias_that_jumps_up_and_down_several_times_is_no_random_walk(way: str) -> None:
    told: list[int] = []
    for seed in range(4):
        rng, lot = np.random.default_rng(seed), lot_in(make(World(units=1), 7_300_000 + seed))
        n = lot.state.time.shape[1]
        # between two soaks a jump is also an effect of temperature, or what a walk did in the pause
        inside = np.flatnonzero(np.arange(n) % (n // 3) > 2)
        jumps = np.sort(rng.choice(inside, 4, replace=False))
        telegraph = 3e-4 * (np.searchsorted(jumps, np.arange(n), side="right") % 2)
        path = telegraph if way == "telegraph" else 6e-5 * np.cumsum(rng.standard_normal(n))
        output = lot.output + np.where(np.arange(3) == seed % 3, path[:, None], 0.0)
        found = diagnose(replace(lot, output=output), BASE, np.random.default_rng(2))
        # a state of few dwells is told as such, in place of the two jumps around it
        near = {dwell for named in found.handled for k in named.dwells for dwell in (k - 1, k, k + 1)}
        near |= {dwell.index[1] for dwell in found.removed}
        told.append(len(set(jumps.tolist()) & near))
        assert not found.named
    assert told == ([4, 4, 4, 4] if way == "telegraph" else [0, 0, 0, 0])
