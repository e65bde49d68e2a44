"""The spectrum against scipy, and against the Allan variance of the same noise."""

import made_noise as generate
import numpy as np
import pytest
from scipy import signal

from inertial.noise.allan import overlapping
from inertial.noise.psd import allan_variance, one_sided


def test_spectrum_and_allan_variance_say_the_same() -> None:
    rng = np.random.default_rng(10)
    x = generate.white(rng, (16, 2**16), 1.0, 1.0) + generate.flicker(rng, (16, 2**16), 1.0)
    spectrum = one_sided(x, 1.0, segment=2**13)
    curve = overlapping(x, 1.0, np.array([16, 64, 128]))
    expected = allan_variance(spectrum.frequency, spectrum.density.mean(axis=0), curve.tau)
    np.testing.assert_allclose(np.mean(curve.deviation**2, axis=0), expected, rtol=0.05)


def test_a_white_density_is_read_off_the_spectrum_as_one_sided() -> None:
    x = generate.white(np.random.default_rng(0), (4, 2**15), 25e-6, 250.0)
    assert np.median(one_sided(x, 250.0).amplitude) == pytest.approx(25e-6, rel=0.03)


@pytest.mark.parametrize(("count", "segment"), [(1000, 125), (1001, 124), (64, 64), (500, 333)])
def test_the_spectrum_is_that_of_scipy_signal(count: int, segment: int) -> None:
    x = np.random.default_rng(61).normal(3.0, 2.0, (2, count))
    frequency, density = signal.welch(x, fs=50.0, nperseg=segment, detrend="constant")
    spectrum = one_sided(x, 50.0, segment=segment)
    np.testing.assert_allclose(spectrum.frequency, frequency, rtol=1e-12)
    np.testing.assert_allclose(spectrum.density, density, rtol=1e-9, atol=1e-14)
