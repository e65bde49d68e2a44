"""Noise that grows with the force along the axis is told from equal noise, and from a curve of the transfer function."""

from dataclasses import replace

import numpy as np
import pytest
from long_suites import mostly_slow
from made_worlds import HIDDEN, NOISES, NULLS, Noise, World, run_of

from benchmarks.large_lots import many_units
from inertial.criticism.examination import ExaminedRun
from inertial.effects import get_all
from inertial.estimation.force_noise import by_force
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of

SEED = 5_700_400


def noisier(run: ExaminedRun, power: float, ug: float) -> np.ndarray:
    """White noise as strong as a power of the force is added to a run; standard deviation (units, n, 3) of all white noise."""
    force = np.abs(np.broadcast_to(run.lot.state.force, run.lot.output.shape))
    added = 1e-6 * ug * force**power
    drawn = np.random.default_rng(SEED).standard_normal(force.shape)
    run.lot = replace(run.lot, output=run.lot.output + added * drawn)
    return np.sqrt(run.lot.error**2 + added**2)


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_noise_that_grows_with_the_force_is_found_in_its_size(power):
    run = run_of(World(noise=Noise(white=10.0, flicker=5.0)), SEED)
    true = noisier(run, power, 40.0)
    found = by_force(run.model())
    assert found is not None
    ratio = found / (true / np.sqrt(np.mean(true**2, axis=1, keepdims=True)))
    assert np.all(np.abs(np.log(ratio[true > 0.5 * true.max()])) < 0.25)


@pytest.mark.parametrize(
    "name", mostly_slow(["B30", "K4", "white", "t3", "lengths", "units_spread", "axis_x3", "one_unit"], "t3")
)
def test_equal_noise_is_not_found_to_grow(name):
    assert [by_force(run_of(NULLS[name], SEED + seed).model()) for seed in range(3)] == [None] * 3


def test_equal_noise_of_many_units_is_not_found_to_grow_where_classes_of_force_differ_in_size():
    """12 poses in three soaks: a class of the force along an axis has 6 to 18 dwells, and the mean log of few lies lower."""
    lot = many_units(128, SEED)
    problem = Problem(lot)
    model = Model(problem, terms_of(get_all(("bias", "scale", "misalignment", "scale_temperature")), problem))
    assert by_force(model) is None


EFFECTS = ["third_order_2", "cross_coupling_2", "adc_nonlinearity_5", "scale_temperature_quadratic_2", "aging_linear_2"]


@pytest.mark.parametrize("name", mostly_slow(EFFECTS, "third_order_2", "adc_nonlinearity_5"))
def test_an_effect_is_no_noise(name):
    assert by_force(run_of(HIDDEN[name], SEED).model()) is None


def test_louder_soaks_are_no_louder_forces_and_poses_without_a_repetition_tell_nothing():
    assert by_force(run_of(NOISES["hot_x4"], SEED).model()) is None
    run = run_of(World(soaks=(25.0,), noise=Noise(white=10.0, flicker=5.0)), SEED)
    noisier(run, 2.0, 40.0)
    assert by_force(run.model()) is None
