"""Faults of data are told from what a sound lot has: a bias that follows the temperature, several ranges, a coarse converter."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from inertial.data_errors.faults import find_faults
from inertial.data_errors.readings import Readings, design, robust_fits

SOAKS = (25.0, 0.0, -20.0, 25.0, 60.0, 25.0)
PER_KELVIN = 1e-3  # g/K, of a usual MEMS device
GAIN_PER_KELVIN = 2.5e-4


def readings(
    rng: np.random.Generator, *, units: int = 1, exchanged: bool = False, sensitivity: tuple[float, ...] = (1.0,)
) -> Readings:
    """Sound units in 16 directions at each of six soaks, 30 µg of noise; two poses of the first unit may be exchanged."""
    z = np.linspace(-0.95, 0.95, 16)
    around = np.arange(16) * 2.4
    poses = np.stack([np.sqrt(1 - z**2) * np.cos(around), np.sqrt(1 - z**2) * np.sin(around), z], axis=-1)
    force = np.tile(poses, (len(SOAKS), 1))
    warm = np.repeat(SOAKS, 16) + rng.normal(0.0, 0.01, (units, len(force)))
    felt = np.repeat(force[None], units, axis=0)
    if exchanged:
        felt[0, [20, 27]] = felt[0, [27, 20]]
    response = np.eye(3) + rng.normal(0.0, 0.004, (units, 3, 3))
    theta = (warm - 25.0)[..., None]
    run = PER_KELVIN * rng.choice([-1.0, 1.0], (units, 1, 3)) * theta
    gain = 1.0 + GAIN_PER_KELVIN * rng.choice([-1.0, 1.0], (units, 1, 3)) * theta
    output = gain * (felt @ np.swapaxes(response, 1, 2)) + rng.normal(0.0, 0.03, (units, 1, 3)) + run
    size = np.resize(sensitivity, units)[:, None, None]
    output = size * (output + rng.normal(0.0, 30e-6, output.shape))
    spread = np.full(output.shape, 2e-4) * size * rng.uniform(0.9, 1.1, output.shape)
    time, count = np.tile(60.0 * np.arange(len(force)), (units, 1)), np.full(warm.shape, 50.0)
    return Readings(np.repeat(force[None], units, axis=0), output, time, spread, count=count, temperature=warm)


@pytest.mark.parametrize("units", [1, 3])
def test_a_bias_that_runs_with_the_temperature_is_no_wrong_pose_and_hides_none(units: int) -> None:
    for seed in range(6):
        assert not find_faults(readings(np.random.default_rng(seed), units=units))
        (fault,) = find_faults(readings(np.random.default_rng(seed), units=units, exchanged=True))
        assert (fault.name, fault.unit, fault.dwells) == ("swapped_dwells", 0, (20, 27))


def test_one_unit_of_another_range_is_told_and_a_lot_of_several_ranges_has_no_odd_one() -> None:
    rng = np.random.default_rng(3)
    odd = find_faults(readings(rng, units=5, sensitivity=(1.0, 1.0, 1.0, 2.0, 1.0)))
    assert [(fault.name, fault.unit) for fault in odd] == [("wrong_range", 3)]
    assert not find_faults(readings(rng, units=6, sensitivity=(1.0, 0.5, 16.0)))
    assert not find_faults(readings(rng, units=4, sensitivity=(1.0, 0.0625)))


def test_a_thermometer_in_another_unit_is_told_by_the_others_and_a_gain_of_a_tenth_is_none() -> None:
    lot = readings(np.random.default_rng(9), units=4)
    assert lot.temperature is not None
    for gain, offset, found in ((1.8, 32.0, [("wrong_units", 2)]), (1.1, 3.0, [])):
        warm = lot.temperature.copy()
        warm[2] = gain * warm[2] + offset
        assert [(fault.name, fault.unit) for fault in find_faults(replace(lot, temperature=warm))] == found


def test_a_dwell_whose_samples_are_one_code_is_stuck_only_where_the_code_is_not_that_of_its_pose() -> None:
    rng = np.random.default_rng(5)
    sound = readings(rng)
    step = 8e-4
    sample = sound.output[:, :, None] + rng.normal(0.0, 0.2 * step, (1, 96, 50, 3))
    codes = step * np.round(sample / step)
    coarse = replace(sound, output=codes.mean(axis=2), spread=codes.std(axis=2))
    assert coarse.spread is not None
    assert np.count_nonzero(coarse.spread < 1e-9) > 20
    assert [fault.name for fault in find_faults(coarse)] == ["quantised"]
    output, spread = coarse.output.copy(), coarse.spread.copy()
    output[0, 40, 1], spread[0, 40, 1] = output[0, 39, 1], 0.0
    (fault,) = find_faults(replace(coarse, output=output, spread=spread))
    assert (fault.name, fault.dwells) == ("stuck_output", (40,))


@pytest.mark.parametrize("axes", [(0, 1, 2), (1,), (2,)])
def test_a_tumble_about_one_axis_tells_the_scale(axes: tuple[int, ...]) -> None:
    angle = np.radians(np.arange(-180.0, 180.0, 15.0))
    force = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], axis=-1)[None]
    output = 0.3 * (force + np.array([0.02, -0.03, 0.04]))[..., axes]
    tumble = Readings(force=force, output=output, time=np.arange(24.0)[None], unit_name="V", axes=axes)
    assert tumble.scale == pytest.approx(0.3, rel=0.05)


def test_dwells_that_no_other_unit_has_are_no_end_of_a_file() -> None:
    two = readings(np.random.default_rng(3), units=2)
    missing = np.zeros(two.time.shape, dtype=bool)
    missing[0, :40] = missing[1, 56:] = True
    output, time = np.where(missing[..., None], np.nan, two.output), np.where(missing, np.nan, two.time)
    parts = replace(two, output=output, time=time)
    assert [(fault.name, fault.unit) for fault in find_faults(parts)] == [("truncated_file", 1)]


def test_a_robust_fit_of_units_together_is_that_of_each_alone_and_minimises_the_biweight() -> None:
    """Units lack dwells of their own and have wrong poses of their own; the loss is minimised by a general method as well."""
    rng = np.random.default_rng(7)
    force = rng.normal(size=(3, 40, 3))
    force /= np.linalg.norm(force, axis=-1, keepdims=True)
    theta = rng.uniform(-30.0, 40.0, (3, 40))
    truth = np.concatenate([0.01 * rng.normal(size=(3, 1, 3)), np.eye(3) + 0.01 * rng.normal(size=(3, 3, 3))], axis=1)
    output = design(force) @ truth + 3e-4 * theta[..., None] + 1e-3 * rng.normal(size=force.shape)
    output[0, 3] += 0.4
    output[2, [5, 9]] -= 0.3
    output[1, :4] = theta[1, :4] = np.nan
    output[2, 20, 1] = np.nan
    together = robust_fits(force, output, theta)
    for unit in range(3):
        there = np.isfinite(output[unit]).all(axis=-1)
        f, y, t = force[unit][there], output[unit][there], theta[unit][there]
        alone = robust_fits(f[None], y[None], t[None])[0]
        np.testing.assert_allclose(together[unit], alone, rtol=0, atol=1e-12)
        x, scale = design(f, t), 4.685 * 1.5 * np.median(np.linalg.norm(y - design(f, t) @ alone.T, axis=-1))

        def loss(flat: np.ndarray) -> float:
            u = np.linalg.norm(y - x @ flat.reshape(3, 8).T, axis=-1) / scale  # noqa: B023
            return float(np.sum(np.where(u < 1.0, 1.0 - (1.0 - u**2) ** 3, 1.0)))

        best = minimize(loss, alone.ravel(), method="BFGS", options={"gtol": 1e-9})
        assert loss(alone.ravel()) - best.fun < 1e-3 * best.fun
        np.testing.assert_allclose(alone[:, :4], truth[unit].T, rtol=0, atol=2e-3)
