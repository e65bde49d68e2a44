"""Covariance of dwell means from the terms of an Allan curve, against noise drawn sample by sample."""

import numpy as np
import pytest

from inertial.noise.allan import overlapping
from inertial.noise.dwells import DwellNoise, dwell_covariance, whitener
from stations.plant.noise import UnitNoise
from stations.plant.preset import load_preset

SERIES = 250


def drawn_means(preset, starts, duration, rate=10.0):
    """Means (dwells, series) of the plant's noise in µg, which knows nothing of the covariance under test."""
    noise = UnitNoise(preset, [np.random.default_rng([7, k]) for k in range(SERIES)])
    before, means = 0.0, []
    for start in starts:
        noise.jump(start - before)
        means.append(noise.sample(round(duration * rate), rate).mean(axis=0))
        before = start + duration
    return 1e6 * np.stack(means).reshape(len(starts), -1)


def noise_of(preset, rate=10.0):
    return DwellNoise(
        1e-6 * preset.sampled_density_ug(rate), 1e-6 * preset.bias_instability_ug, 1e-6 * preset.rate_random_walk_ug
    )


@pytest.mark.parametrize("name", ["SF1500", "ADXL355", "analogue"])
def test_differences_of_dwells_scatter_as_the_covariance_says(name):
    preset = load_preset(name)
    starts = np.cumsum([900.0, 20.0, 20.0, 20.0, 1500.0, 20.0, 20.0])
    means = drawn_means(preset, starts, 10.0)
    covariance = 1e12 * dwell_covariance(starts + 5.0, 10.0, noise_of(preset))
    pairs = [(i, j) for i in range(7) for j in range(i)]
    said = np.sqrt([covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j] for i, j in pairs])
    scatter = np.array([np.std(means[i] - means[j]) for i, j in pairs])
    assert scatter == pytest.approx(said, rel=0.12)
    assert np.mean(scatter / said) == pytest.approx(1.0, abs=0.05)


def test_the_error_of_a_dwell_is_the_allan_deviation_at_its_length():
    preset = load_preset("SF1500").model_copy(update={"rate_random_walk_ug": 0.0})
    record = UnitNoise(preset, [np.random.default_rng(3)]).sample(60_000, 20.0)[:, 0, :].T
    curve = overlapping(1e6 * record, 20.0)
    at = int(np.argmin(np.abs(curve.tau - 10.0)))
    said = 1e6 * noise_of(preset).error(float(curve.tau[at]))
    assert np.mean(curve.deviation[:, at]) == pytest.approx(said, rel=0.15)


def test_a_whitener_makes_noise_white():
    time = np.array([0.0, 20.0, 40.0, 900.0, 920.0]) + 1000.0
    covariance = dwell_covariance(time, 10.0, DwellNoise(1e-5, 1e-4, 1e-6))
    white = whitener(covariance)
    assert white @ covariance @ white.T == pytest.approx(np.eye(5), abs=1e-9)


def test_dwells_are_long_enough_when_white_noise_has_fallen_to_the_wander():
    noise = DwellNoise(1e-5, 1e-5)
    assert noise.white(noise.balanced()) == pytest.approx(noise.wander(noise.balanced()))
    assert DwellNoise(1e-5).balanced() == float("inf")
