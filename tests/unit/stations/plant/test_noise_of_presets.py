"""Noise and response of the simulated devices are what their presets say."""

import numpy as np
import pytest
from scipy.signal import freqs, welch

from stations.plant.dynamics import Dynamics, transfer
from stations.plant.noise import UnitNoise
from stations.plant.preset import load_preset, preset_names

RATE = 100.0


def preset_with(name: str = "ADXL355", **figures: float):
    still = {"noise_density_ug": 0.0, "bias_instability_ug": 0.0, "rate_random_walk_ug": 0.0}
    return load_preset(name, still | figures)


def streams(n: int):
    return [np.random.default_rng([11, i]) for i in range(n)]


def allan(x: np.ndarray, m: int) -> np.ndarray:
    """Allan deviation of neighbouring means of m samples, per column."""
    means = x[: len(x) // m * m].reshape(-1, m, x.shape[1]).mean(axis=1)
    return np.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2, axis=0))


@pytest.mark.parametrize("name", preset_names())
def test_white_density_comes_back_as_the_preset_says(name):
    density = load_preset(name).noise_density_ug
    bare = preset_with(name, noise_density_ug=density, noise_bandwidth_hz=0.0)
    x = UnitNoise(bare, streams(4)).sample(40_000, RATE)
    assert x.shape == (40_000, 4, 3)
    frequency, power = welch(x.reshape(len(x), -1), RATE, nperseg=1024, axis=0)
    band = (frequency > 1.0) & (frequency < 45.0)
    assert np.sqrt(power[band].mean()) == pytest.approx(density * 1e-6, rel=0.01)
    assert x.std() == pytest.approx(density * 1e-6 * np.sqrt(RATE / 2.0), rel=0.01)


@pytest.mark.slow
def test_allan_deviation_of_flicker_is_flat_at_0_664_of_the_instability():
    x = UnitNoise(preset_with(bias_instability_ug=100.0), streams(16)).sample(60_000, 10.0).reshape(60_000, -1)
    for m in (50, 100, 200):
        assert np.sqrt(np.mean(allan(x, m) ** 2)) == pytest.approx(66.4e-6, rel=0.06)


def test_random_walk_grows_with_the_root_of_time():
    noise = UnitNoise(preset_with(rate_random_walk_ug=4.0), streams(200))
    noise.jump(50.0)
    x = noise.sample(500, RATE)
    assert x[-1].std() == pytest.approx(4e-6 * np.sqrt(55.0), rel=0.1)


def test_noise_of_a_unit_does_not_depend_on_how_it_is_asked_for_or_on_its_neighbours():
    preset = load_preset("ADXL355")
    whole, parts = UnitNoise(preset, streams(2)), UnitNoise(preset, streams(2))
    expected = whole.sample(1000, RATE)
    assert np.array_equal(expected, np.concatenate([parts.sample(n, RATE) for n in (1, 499, 7, 493)]))
    assert np.array_equal(UnitNoise(preset, streams(1)).sample(1000, RATE)[:, 0], expected[:, 0])


@pytest.mark.parametrize("name", preset_names())
def test_bandwidth_of_the_chain_is_the_sheets(name):
    preset = load_preset(name)
    _, gain = freqs(*transfer(preset), worN=2.0 * np.pi * np.array([1e-3, preset.passband_hz]))
    assert abs(gain[0]) == pytest.approx(1.0, abs=1e-9)
    assert 20.0 * np.log10(abs(gain[1])) == pytest.approx(-3.01, abs=0.01)


def test_sampled_response_follows_the_mass_on_its_spring():
    preset = load_preset("QA700")
    rate, n = 50_000.0, 20_000
    dynamics = Dynamics(preset)
    dynamics.begin(rate, np.zeros((1, 3)))
    time = np.arange(1, n + 1) / rate
    shake = np.sin(2.0 * np.pi * preset.bandwidth_hz * time)
    out = dynamics.respond(np.repeat(shake[:, None, None], 3, axis=2))[n // 2 :, 0, 0]
    assert np.sqrt(2.0) * out.std() == pytest.approx(1.0 / np.sqrt(2.0), rel=0.01)
    force = np.array([[0.3, -0.5, 0.8]])  # at rest it is the force
    dynamics.begin(100.0, force)
    still = np.broadcast_to(force, (20, 1, 3))
    assert dynamics.respond(still) == pytest.approx(still, abs=1e-12)
