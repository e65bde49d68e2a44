"""Covariance of dwell means from the terms of an Allan curve, against noise drawn sample by sample."""

import numpy as np
import pytest

from inertial.noise.allan import overlapping
from inertial.noise.dwells import DwellNoise, dwell_covariance, whitener
from stations.plant.noise import UnitNoise
from stations.plant.preset import load_preset


def test_the_error_of_a_dwell_is_the_allan_deviation_at_its_length():
    preset = load_preset("SF1500").model_copy(update={"rate_random_walk_ug": 0.0})
    record = UnitNoise(preset, [np.random.default_rng(3)]).sample(60_000, 20.0)[:, 0, :].T
    curve = overlapping(1e6 * record, 20.0)
    at = int(np.argmin(np.abs(curve.tau - 10.0)))
    said = DwellNoise(preset.sampled_density_ug(10.0), preset.bias_instability_ug).error(float(curve.tau[at]))
    assert np.mean(curve.deviation[:, at]) == pytest.approx(said, rel=0.15)


def test_a_walk_has_its_closed_forms():
    noise, time = DwellNoise(0.0, 0.0, 2e-6), np.array([110.0, 310.0])
    assert noise.error(12.0) == pytest.approx(2e-6 * np.sqrt(12.0 / 3.0))
    expected = 4e-12 * np.array([[100.0 - 2.0, 100.0], [100.0, 300.0 - 2.0]])  # a mean loses a sixth of its length
    assert dwell_covariance(time, 12.0, noise, since=10.0) == pytest.approx(expected)


def test_a_whitener_makes_noise_white():
    time = np.array([0.0, 20.0, 40.0, 900.0, 920.0]) + 1000.0
    covariance = dwell_covariance(time, 10.0, DwellNoise(1e-5, 1e-4, 1e-6))
    white = whitener(covariance)
    assert white @ covariance @ white.T == pytest.approx(np.eye(5), abs=1e-9)


def test_dwells_are_long_enough_when_white_noise_has_fallen_to_the_wander():
    noise = DwellNoise(1e-5, 1e-5)
    assert noise.white(noise.balanced()) == pytest.approx(noise.wander(noise.balanced()))
    assert DwellNoise(1e-5).balanced() == float("inf")
