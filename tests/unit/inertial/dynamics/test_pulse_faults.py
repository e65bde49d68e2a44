"""Tops that are cut off are told from those that are round, and rebounds from ringing, over many pulses."""

import numpy as np
import pytest
from long_suites import mostly_slow
from scipy import signal

from inertial.dynamics.pulse_faults import flat_top, other_pulses

RATE_HZ = 50_000.0


def pulse(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Time, and a half sine through a mounting, 1 at its peak; duration, s, and a noise of 0.01 to 1 %."""
    duration = float(rng.uniform(1e-3, 11e-3))
    t = np.arange(int((0.03 + 8.0 * duration) * RATE_HZ)) / RATE_HZ - 0.02
    force = np.sin(np.pi * t / duration) * ((t > 0.0) & (t < duration))
    natural, zeta = 2.0 * np.pi * rng.uniform(1.0, 20.0) / duration, rng.uniform(0.02, 0.7)
    felt = signal.lsim(([2.0 * zeta * natural, natural**2], [1.0, 2.0 * zeta * natural, natural**2]), force, t - t[0])
    return t, felt[1] / np.max(np.abs(felt[1])), duration, 10.0 ** float(rng.uniform(-4.0, -2.0))


@pytest.mark.parametrize("block", mostly_slow(range(3), 0))
def test_a_cut_top_is_found_and_a_round_one_is_none(block: int) -> None:
    missed, false = [], []
    for k in range(60):
        rng = np.random.default_rng([907, block, k])
        t, wave, duration, noise = pulse(rng)
        spread = noise * rng.standard_normal(t.size)
        false.append(flat_top(wave + spread, RATE_HZ, duration, noise, 0.0) > 0)
        missed.append(flat_top(np.minimum(wave, 0.7) + spread, RATE_HZ, duration, noise, 0.0) == 0)
    assert sum(false) <= 1
    assert np.mean(missed) < 0.1


@pytest.mark.parametrize("block", mostly_slow(range(3), 0))
def test_a_rebound_is_found_and_a_ringing_is_none(block: int) -> None:
    missed, false = [], []
    for k in range(60):
        rng = np.random.default_rng([908, block, k])
        t, wave, duration, noise = pulse(rng)
        spread = noise * rng.standard_normal(t.size)
        false.append(any(other_pulses(wave + spread, RATE_HZ, duration)))
        at, size = float(rng.uniform(2.5, 5.0)) * duration, float(rng.uniform(0.3, 0.9))
        again = size * np.sin(np.pi * (t - at) / duration) * ((t > at) & (t < at + duration))
        earlier, later = other_pulses(wave + again + spread, RATE_HZ, duration)
        missed.append(
            bool(earlier) or len(later) != 1 or abs(later[0].at_s - 0.02 - at - 0.5 * duration) > 0.3 * duration
        )
    assert sum(false) == 0
    assert np.mean(missed) < 0.1


def test_a_half_sine_of_few_samples_at_its_top_is_not_cut_off(rng: np.random.Generator) -> None:
    """3 to 10 kHz, 11 ms, noise of 0.01 to 0.5 % of the peak, any phase of the samples."""
    for rate, noise in ((3000, 1e-3), (4000, 1e-3), (4000, 2e-3), (5000, 3e-4), (10_000, 5e-3)):
        for _ in range(60):
            time = (np.arange(rate // 20) + rng.random()) / rate - 0.0165
            wave = np.where((time > 0.0) & (time < 0.011), np.sin(np.pi * time / 0.011), 0.0)
            record = 30.0 * (wave + noise * rng.standard_normal(time.size))
            assert flat_top(record, rate, 0.011, 30.0 * noise, 0.0) == 0
