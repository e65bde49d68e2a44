"""Lines of a spectrum are found at their frequency with their size; coloured noise has none."""

import numpy as np
import pytest

from inertial.noise.psd import Spectrum, one_sided, spectral_lines

RATE = 200.0


def lines_of(record: np.ndarray) -> list[tuple[float, float]]:
    return spectral_lines(one_sided(record, RATE), record.size)


def noise(rng: np.random.Generator, n: int, slope: float) -> np.ndarray:
    f = np.fft.rfftfreq(n)
    spectrum = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
    spectrum[1:] *= f[1:] ** (-slope / 2.0)
    made = np.fft.irfft(spectrum * (np.arange(f.size) > 0), n)
    return made / made.std() + (0.1 * rng.standard_normal(n) if slope else 0.0)


@pytest.mark.parametrize("slope", [0.0, 1.0, 2.0, 2.5])
def test_noise_has_no_lines(slope: float) -> None:
    told = []
    for k in range(25):
        rng = np.random.default_rng([91, k])
        told += lines_of(noise(rng, int(2.0 ** rng.uniform(11.0, 16.0)), slope))
    assert told == []


@pytest.mark.parametrize("frequency", [7.3, 50.0, 91.0])
def test_a_line_is_found_with_its_size(frequency: float) -> None:
    rng = np.random.default_rng(17)
    n = 40_000
    record = rng.standard_normal(n) + 0.3 * np.sin(2.0 * np.pi * frequency * np.arange(n) / RATE)
    ((found, rms),) = lines_of(record)
    assert found == pytest.approx(frequency, abs=2.0 * RATE / (n // 8))
    assert rms == pytest.approx(0.3 / np.sqrt(2.0), rel=0.1)


def test_a_short_spectrum_is_not_judged() -> None:
    assert spectral_lines(Spectrum(np.arange(20.0), np.ones(20)), 40) == []
