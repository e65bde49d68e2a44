"""Frequency responses of whole recordings against the system that made them, and against averages over segments."""

import numpy as np
import pytest
from long_suites import mostly_slow
from scipy import signal

from inertial.dynamics.frequency_response import clock_departure, frequency_response
from inertial.errors import NotIdentified

RATE_HZ, NATURAL_HZ, DELAY_S = 10_000.0, 1200.0, 3.3e-4


def truth(frequency, damping):
    ratio = frequency / NATURAL_HZ
    return np.exp(-2j * np.pi * frequency * DELAY_S) / (1.0 - ratio**2 + 2j * damping * ratio)


def recorded(kind, damping, noise, rng, seconds=5.0):
    """Motion and answer of a second-order system, filtered over a longer record so that no ends wrap around."""
    n = int(RATE_HZ * seconds)
    if kind == "random":
        x = rng.standard_normal(2 * n)
    else:
        t = np.arange(int(0.9 * n)) / RATE_HZ
        chirp = signal.chirp(t, 5.0, t[-1], 3000.0, method="log") * signal.windows.tukey(t.size, 0.02)
        x = np.pad(chirp, (n // 2 + n // 20, 2 * n - t.size - n // 2 - n // 20))
    y = np.fft.irfft(np.fft.rfft(x) * truth(np.fft.rfftfreq(2 * n, 1.0 / RATE_HZ), damping), 2 * n)
    inside = slice(n // 2, n // 2 + n)
    return x[inside], y[inside] + noise * rng.standard_normal(n)


@pytest.mark.parametrize("kind", mostly_slow(["random", "sweep"], "random"))
@pytest.mark.parametrize("damping", mostly_slow([0.6, 0.05], 0.05))
def test_intervals_cover_the_response(kind, damping):
    rng, inside, deviations = np.random.default_rng(240_861), [], []
    for _ in range(12):
        x, y = recorded(kind, damping, 0.1, rng)
        got = frequency_response((x, RATE_HZ), (y, RATE_HZ))
        shown = (got.frequency > 10.0) & (got.frequency < 2500.0)
        apart = np.log(got.h1 / truth(got.frequency, damping))[shown]
        inside += [np.abs(apart.real) < 2.0 * got.error[shown], np.abs(apart.imag) < 2.0 * got.error[shown]]
        deviations.append(np.median(np.abs(apart)))
    assert 0.92 < np.mean(np.concatenate(inside)) < 0.98
    assert np.mean(deviations) < 0.02


@pytest.mark.slow
def test_h1_and_coherence_are_those_of_averages_over_segments():
    x, y = recorded("random", 0.6, 0.1, np.random.default_rng(11), seconds=60.0)
    got = frequency_response((x, RATE_HZ), (y, RATE_HZ), per_octave=6)
    f, across = signal.csd(x, y, RATE_HZ, nperseg=4096)
    _, power = signal.welch(x, RATE_HZ, nperseg=4096)
    _, coherence = signal.coherence(x, y, RATE_HZ, nperseg=4096)
    shown = (got.frequency > 200.0) & (got.frequency < 2000.0)
    assert np.abs(got.h1[shown]) == pytest.approx(np.interp(got.frequency[shown], f, np.abs(across / power)), rel=0.03)
    assert got.coherence[shown] == pytest.approx(np.interp(got.frequency[shown], f, coherence), abs=0.03)


def test_noise_of_the_reference_lowers_h1_and_not_h2():
    rng = np.random.default_rng(12)
    x, y = recorded("random", 0.6, 0.0, rng, seconds=30.0)
    got = frequency_response((x + 0.5 * rng.standard_normal(x.size), RATE_HZ), (y, RATE_HZ))
    low = (got.frequency > 50.0) & (got.frequency < 300.0)
    assert np.mean(np.abs(got.h1[low] / truth(got.frequency[low], 0.6))) == pytest.approx(1.0 / 1.25, rel=0.02)
    assert np.mean(np.abs(got.h2[low] / truth(got.frequency[low], 0.6))) == pytest.approx(1.0, rel=0.02)


def test_channels_of_two_rates_and_a_late_start_give_the_same_response():
    x, y = recorded("sweep", 0.6, 0.001, np.random.default_rng(13))
    late = 40
    got = frequency_response((x, RATE_HZ), (y[late::2], RATE_HZ / 2.0), late_s=late / RATE_HZ)
    shown = (got.frequency > 20.0) & (got.frequency < 1500.0)
    assert np.max(np.abs(np.log(got.h1 / truth(got.frequency, 0.6))[shown])) < 0.03


def test_an_output_that_does_not_follow_is_refused():
    x, other = np.random.default_rng(2).standard_normal((2, 50_000))
    for y, said in ((other, "in no band"), (np.ones(30), "record longer")):
        with pytest.raises(NotIdentified, match=said):
            frequency_response((x, RATE_HZ), (y, RATE_HZ))


@pytest.mark.parametrize("departure", [0.0, 4e-5, -2e-4])
def test_a_clock_that_departs_is_found_and_the_response_follows_from_it(departure):
    rng, seconds, own_hz = np.random.default_rng(14), 6.0, 4000.0
    x, y = recorded("random", 0.6, 0.0, rng, seconds=seconds + 0.1)
    x, y = (signal.sosfiltfilt(signal.butter(8, 1500.0, fs=RATE_HZ, output="sos"), one) for one in (x, y))
    # what a converter with a clock of its own samples, from the band-limited motion
    fine = signal.resample(y, 8 * y.size)
    at = np.arange(int(seconds * own_hz)) / own_hz * (1.0 + departure)
    own = np.interp(at, np.arange(fine.size) / (8.0 * RATE_HZ), fine)
    got, error = clock_departure((x, RATE_HZ), (own, own_hz))
    assert abs(got - departure) < max(4.0 * error, 2e-7)
    response = frequency_response((x, RATE_HZ), (own, own_hz / (1.0 + got)))
    shown = (response.frequency > 20.0) & (response.frequency < 1000.0)
    assert np.max(np.abs(np.log(response.h1 / truth(response.frequency, 0.6))[shown])) < 0.02
