"""Cut tops are told from round ones, rebounds from ringing, and single samples that are off from all that a pulse may have."""

import numpy as np
import pytest
from long_suites import mostly_slow
from scipy import signal

from inertial.dynamics.pulse_faults import flat_top, lone_samples, other_pulses

RATE_HZ = 50_000.0


def through_a_mounting(
    rng: np.random.Generator, rate: float, duration: float, highest: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Time, and a half sine of 1 through a mounting of a resonance, below ``highest`` Hz, and a damping of its own."""
    t = np.arange(int((0.03 + 8.0 * duration) * rate)) / rate - 0.02
    force = np.sin(np.pi * t / duration) * ((t > 0.0) & (t < duration))
    natural, zeta = 2.0 * np.pi * min(rng.uniform(1.0, 20.0) / duration, highest), rng.uniform(0.02, 0.7)
    system = [2.0 * zeta * natural, natural**2], [1.0, 2.0 * zeta * natural, natural**2]
    return t, signal.lsim(system, force, t - t[0])[1]


def pulse(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Time, and a pulse, 1 at its peak; duration, s, and a noise of 0.01 to 1 %."""
    duration = float(rng.uniform(1e-3, 11e-3))
    t, felt = through_a_mounting(rng, RATE_HZ, duration)
    return t, felt / np.max(np.abs(felt)), duration, 10.0 ** float(rng.uniform(-4.0, -2.0))


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
        near = [abs(one.at_s - 0.02 - at - 0.5 * duration) <= 0.3 * duration for one in later]
        missed.append(bool(earlier) or near != [True])
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


@pytest.mark.parametrize("together", mostly_slow([1, 2], 2))
@pytest.mark.parametrize("block", mostly_slow(range(3), 0))
def test_a_sample_that_is_off_is_found_and_nothing_else_is(block: int, together: int) -> None:
    """Pulses of 0.5 to 11 ms at 10 to 100 kHz, 0.01 to 1 % of noise, some of them clipped, some in coarse digits."""
    missed, false = [], []
    for k in range(60):
        rng = np.random.default_rng([4471, block, k])
        rate, duration = float(rng.choice([10e3, 20e3, 51.2e3, 100e3])), float(rng.uniform(0.5e-3, 11e-3))
        felt = 100.0 * through_a_mounting(rng, rate, duration, 0.2 * rate)[1]
        kind = rng.integers(3)
        record = np.minimum(felt, 0.7 * felt.max()) if kind == 1 else felt
        record = record + rng.uniform(0.01, 1.0) * rng.standard_normal(record.size)
        record = np.round(record / 2.0) * 2.0 if kind == 2 else record
        if rate * duration < 24.0:
            continue
        false.append(lone_samples(record, rate, duration).size > 0)
        at = int(rng.integers(20, record.size - 20))
        sizes = rng.choice([-1.0, 1.0], together) * rng.uniform(0.4, 2.0, together)
        record[at : at + together] += sizes * np.ptp(record)
        missed.append(not np.any(np.abs(lone_samples(record, rate, duration) - at) < together))
    assert len(false) > 30
    assert sum(false) == 0
    assert np.mean(missed) < 0.1
