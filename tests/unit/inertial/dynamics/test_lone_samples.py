"""Samples of a shock that depart alone are found, and neither pulses, nor ringing, clipping or coarse digits are any."""

import numpy as np
import pytest
from long_suites import mostly_slow
from scipy import signal

from inertial.dynamics.pulse_faults import lone_samples


def pulse(rng: np.random.Generator) -> tuple[np.ndarray, float, float]:
    """A half sine of 0.5 to 11 ms through a mounting of a resonance and a damping of its own, with noise; rate and duration."""
    rate, duration = rng.choice([10e3, 20e3, 51.2e3, 100e3]), rng.uniform(0.5e-3, 11e-3)
    t = np.arange(int((0.03 + 8.0 * duration) * rate)) / rate - 0.02
    force = 100.0 * np.sin(np.pi * t / duration) * ((t > 0.0) & (t < duration))
    natural, zeta = 2.0 * np.pi * min(rng.uniform(1.0, 20.0) / duration, 0.2 * rate), rng.uniform(0.02, 0.7)
    felt = signal.lsim(([2.0 * zeta * natural, natural**2], [1.0, 2.0 * zeta * natural, natural**2]), force, t - t[0])[
        1
    ]
    kind = rng.integers(3)
    felt = np.minimum(felt, 0.7 * felt.max()) if kind == 1 else felt
    felt = felt + rng.uniform(0.01, 1.0) * rng.standard_normal(t.size)
    return (np.round(felt / 2.0) * 2.0 if kind == 2 else felt), float(rate), float(duration)


@pytest.mark.parametrize("together", mostly_slow([1, 2], 2))
@pytest.mark.parametrize("block", mostly_slow(range(3), 0))
def test_a_sample_that_is_off_is_found_and_nothing_else_is(block: int, together: int) -> None:
    missed, false = [], []
    for k in range(60):
        rng = np.random.default_rng([4471, block, k])
        record, rate, duration = pulse(rng)
        if rate * duration < 24.0:
            continue
        false.append(lone_samples(record, rate, duration).size > 0)
        at = int(rng.integers(20, record.size - 20))
        record[at : at + together] += (
            rng.choice([-1.0, 1.0], together) * rng.uniform(0.4, 2.0, together) * np.ptp(record)
        )
        missed.append(not np.any(np.abs(lone_samples(record, rate, duration) - at) < together))
    assert len(false) > 30
    assert sum(false) == 0
    assert np.mean(missed) < 0.1
