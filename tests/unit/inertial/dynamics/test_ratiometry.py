"""Departures over the supply: closed forms, pulls, and what noise alone would be taken for."""

import numpy as np
import pytest

from inertial.dynamics.ratiometry import departures, largest_departure, slope_over, zero_and_sensitivity
from inertial.dynamics.transverse import fit_transverse


def test_a_ratiometric_output_departs_by_its_error_alone() -> None:
    supply, error = np.array([3.0, 2.7, 3.3]), 0.02
    ratio = supply / 3.0
    sensitivity, zero = 0.3 * ratio * (1.0 + error * (ratio - 1.0)), 1.5 * ratio
    means = np.column_stack([zero + sensitivity, zero - sensitivity])
    z, s, u = zero_and_sensitivity(means, np.full((3, 2), 1e-5))
    follows = departures(supply, z, s, u, follows=True)
    assert follows.sensitivity == pytest.approx([0.0, -0.002, 0.002], abs=1e-12)
    assert follows.zero_g == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    fixed = departures(supply, z, s, u, follows=False)
    assert fixed.slope_g_V == pytest.approx(1.5 / 3.0 / 0.3, rel=1e-9)


def test_pulls_over_the_supply_and_over_the_angle(rng: np.random.Generator) -> None:
    supply, pulls = np.array([12.0, 11.0, 11.5, 12.5, 13.0]), []
    angle = np.radians(np.arange(0.0, 360.0, 30.0))
    for _ in range(300):
        zero, gain = 1e-3 * rng.normal(), 2e-3 * rng.normal()
        part = supply / 12.0 - 1.0
        means = np.column_stack([5e-4 + zero * part + s * (1.0 + gain * part) for s in (1.0, -1.0)])
        z, s, u = zero_and_sensitivity(means + 2e-5 * rng.normal(size=(5, 2)), np.full((5, 2), 2e-5))
        one = departures(supply, z, s, u, follows=False)
        size, turn = rng.uniform(2e-3, 2e-2), rng.uniform(-np.pi, np.pi)
        output = size * np.cos(angle - turn) + 0.01 * rng.normal() + 5e-5 * rng.normal(size=angle.size)
        across = fit_transverse(np.cos(angle), np.sin(angle), output, np.full(angle.size, 5e-5))
        away = (across.direction_deg - np.degrees(turn) + 180.0) % 360.0 - 180.0
        pulls.append(
            (
                (one.slope_g_V - zero / 12.0) / one.slope_error_g_V,
                (one.sensitivity[4] - gain / 12.0) / one.sensitivity_error[4],
                (across.value - size) / across.error,
                away / across.direction_error_deg,
            )
        )
    assert np.all(np.abs(np.std(pulls, axis=0, ddof=1) - 1.0) < 0.12)


def test_a_departure_within_the_noise_is_held_by_its_interval(rng: np.random.Generator) -> None:
    supply, own = np.array([12.0, 10.0, 11.0, 12.5, 13.0]), np.full(5, 1e-4)
    true = 5e-5 * (supply - 12.0) / -2.0  # 0.35 standard uncertainties at the farthest supply
    held, sizes, largest = 0, [], []
    for _ in range(2000):
        noise = 1e-4 * rng.normal(size=5)
        shifts = true + noise - noise[0]
        value, error, _ = largest_departure(supply, shifts, own)
        held += abs(abs(value) - 5e-5) <= 1.96 * error
        sizes.append(abs(value))
        largest.append(max(np.abs(shifts)))
    assert held >= 0.89 * 2000
    assert np.mean(sizes) < 0.7 * np.mean(largest)  # noise alone is not taken for a departure
    bent = np.array([0.0, 5e-3, 0.0, 0.0, 0.0])  # the sensitivity falls where the supply is too low: no line
    assert largest_departure(supply, bent, own) == (5e-3, pytest.approx(np.sqrt(2.0) * 1e-4), 1)


@pytest.mark.parametrize("supplies", [(12.0, 10.0, 11.0, 13.0, 14.0), (12.0, 11.0, 13.0)])
def test_a_curve_symmetric_about_the_first_supply_has_its_departure_and_a_slope(supplies, rng):
    supply, own = np.array(supplies), np.full(len(supplies), 1.0)
    for size in (2.0, 3.0, 8.0):
        true = size * (supply - 12.0) ** 2 / np.max((supply - 12.0) ** 2)
        held, steep = 0, 0
        for _ in range(1000):
            noise = rng.normal(size=supply.size)
            shifts = true + noise - noise[0]
            value, error, _ = largest_departure(supply, shifts, own)
            held += abs(value - size) <= 1.96 * error
            slope, of_slope = slope_over(supply, shifts, own)
            steep += abs(slope) > 2.0 * of_slope
        assert held >= 900
    assert steep >= 950  # the line alone has no slope: it is told in 5 %
