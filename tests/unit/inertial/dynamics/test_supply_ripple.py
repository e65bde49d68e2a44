"""The line of a ripple: amplitude without the share of the noise, and the rejection with its uncertainty."""

import numpy as np
import pytest

from inertial.dynamics.supply_ripple import Line, rejection_db, ripple_line

RATE, COUNT = 4000.0, 8000
TIME = np.arange(COUNT) / RATE


@pytest.mark.slow
def test_amplitudes_near_the_noise_are_right_on_average_in_power_and_their_error_is_that_of_draws() -> None:
    rng = np.random.default_rng(2)
    sigma = 1.0
    true = 8.0 * sigma * np.sqrt(2.0 / COUNT)
    lines = [
        ripple_line(0.3 + true * np.sin(2.0 * np.pi * 123.0 * TIME + 1.0) + rng.normal(0.0, sigma, COUNT), RATE, 123.0)
        for _ in range(120)
    ]
    amplitude = np.array([one.amplitude for one in lines])
    assert np.sqrt(np.mean(amplitude**2)) == pytest.approx(true, rel=0.03)
    assert np.std(amplitude) == pytest.approx(np.mean([one.error for one in lines]), rel=0.1)


def test_noise_that_is_louder_at_low_frequencies_makes_no_line() -> None:
    rng = np.random.default_rng(3)
    f = np.fft.rfftfreq(COUNT, 1.0 / RATE)
    found = []
    for _ in range(100):
        spectrum = (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)) / np.sqrt(np.maximum(f, 0.1))
        line = ripple_line(np.fft.irfft(spectrum, COUNT), RATE, 20.0)
        found.append(line.amplitude > 4.0 * line.error)
    assert np.mean(found) < 0.02


def test_a_clear_line_of_another_clock_is_found_at_its_own_frequency() -> None:
    record = np.sin(2.0 * np.pi * 1000.0 * (1.0 + 3e-4) * TIME)
    assert ripple_line(record, RATE, 1000.0).amplitude == pytest.approx(1.0, abs=1e-3)


def test_rejection_is_the_ratio_in_db_and_no_more_than_the_noise_shows() -> None:
    value, u = rejection_db(Line(0.1, 0.001), Line(1e-4, 1e-6))
    assert value == pytest.approx(60.0)
    assert u == pytest.approx(8.686 * np.hypot(0.01, 0.01), rel=1e-3)
    hidden, wide = rejection_db(Line(0.1, 0.001), Line(0.0, 1e-6))
    assert hidden == pytest.approx(100.0)
    assert wide == pytest.approx(8.686, rel=0.01)
