"""Dynamic tests give back the system that they were made with."""

import numpy as np
import pytest

from inertial.dynamic import (
    bandwidth,
    centrifuge,
    damping_from_peak,
    fit_second_order,
    half_sine,
    settling_time,
    transfer,
)
from inertial.errors import NotIdentified


@pytest.mark.parametrize(("natural", "damping"), [(2500.0, 0.7), (2200.0, 0.6), (1800.0, 0.75), (900.0, 0.05)])
def test_the_gain_at_the_bandwidth_is_three_decibels_down(natural: float, damping: float) -> None:
    assert abs(transfer(bandwidth(natural, damping), natural, damping)) == pytest.approx(1.0 / np.sqrt(2.0))
    assert transfer(0.0, natural, damping) == -1.0
    assert np.angle(-transfer(natural, natural, damping)) == pytest.approx(-np.pi / 2.0)


@pytest.mark.parametrize(("natural", "damping"), [(2500.0, 0.7), (900.0, 0.05)])
def test_a_sweep_returns_natural_frequency_damping_and_sensitivity(
    natural: float, damping: float, rng: np.random.Generator
) -> None:
    f = np.geomspace(5.0, 1.5 * natural, 80)
    gain = 0.3 * np.abs(transfer(f, natural, damping)) * (1.0 + 1e-3 * rng.normal(size=80))
    fit = fit_second_order(f, gain)
    assert fit.natural_hz == pytest.approx(natural, rel=2e-3)
    assert fit.damping == pytest.approx(damping, rel=0.03)
    assert fit.sensitivity == pytest.approx(0.3, rel=2e-3)


def test_the_width_of_the_peak_gives_a_small_damping() -> None:
    f = np.linspace(1.0, 3000.0, 30_000)
    assert damping_from_peak(f, np.abs(transfer(f, 1500.0, 0.05))) == pytest.approx(0.05, rel=0.02)
    with pytest.raises(NotIdentified, match="never falls 3 dB"):
        damping_from_peak(f, np.abs(transfer(f, 1500.0, 0.7)))


def test_a_sweep_that_stays_flat_is_refused() -> None:
    f = np.linspace(1.0, 20.0, 40)
    with pytest.raises(NotIdentified, match="does not bend"):
        fit_second_order(f, 1.0 + 0.01 * np.sin(f))


def test_a_slow_half_sine_comes_through_and_a_fast_one_overshoots() -> None:
    slow, fast = half_sine(50.0, 0.010, 2500.0, 0.7), half_sine(50.0, 0.001, 900.0, 0.05)
    assert abs(slow.overshoot) < 0.02
    assert fast.overshoot > 0.3
    assert fast.undershoot > 0.1
    assert slow.return_s < fast.return_s


def test_settling_is_the_time_after_which_nothing_leaves_the_band() -> None:
    t = np.linspace(0.0, 10.0, 10_001)
    assert settling_time(t, 1.0 - np.exp(-t), final=1.0, band=0.01) == pytest.approx(np.log(100.0), abs=2e-3)
    with pytest.raises(NotIdentified, match="record longer"):
        settling_time(t[:1000], 1.0 - np.exp(-t[:1000]), final=1.0, band=0.01)


def test_a_centrifuge_returns_bias_scale_and_linearity(rng: np.random.Generator) -> None:
    omega = np.linspace(5.0, 45.0, 12)
    force = 0.25 * omega**2 / 9.80665
    straight = centrifuge(omega, 0.02 + 0.007 * force + 1e-7 * rng.normal(size=12), 0.25, full_scale_g=50.0)
    assert (straight.bias, straight.scale) == pytest.approx((0.02, 0.007), rel=1e-4)
    bent = centrifuge(omega, 0.02 + 0.007 * (force + 2e-5 * force**2), 0.25, full_scale_g=50.0)
    assert bent.linearity_percent > 10.0 * straight.linearity_percent
