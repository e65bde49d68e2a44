"""Supply and angle: departures, transverse sensitivity, phases, and the line of a ripple with its rejection."""

from typing import Any

import numpy as np
import pytest

from inertial.dynamics.ratiometry import departures, largest_departure, slope_over, zero_and_sensitivity
from inertial.dynamics.supply_ripple import Line, rejection_db, ripple_line
from inertial.dynamics.transverse import fit_transverse, relative_phase
from inertial.errors import NotIdentified


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
        off = (one.slope_g_V - zero / 12.0, one.sensitivity[4] - gain / 12.0, across.value - size, away)
        stated = (one.slope_error_g_V, one.sensitivity_error[4], across.error, across.direction_error_deg)
        pulls.append(np.divide(off, stated))
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


@pytest.mark.slow
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


def test_no_transverse_sensitivity_gives_an_upper_limit_and_no_direction(rng: np.random.Generator) -> None:
    angle = np.radians(np.arange(0.0, 360.0, 45.0))
    across, error = (np.cos(angle), np.sin(angle)), np.full(8, 1e-5)
    fits = [fit_transverse(*across, 1e-5 * rng.normal(size=8), error) for _ in range(300)]
    assert sum(one.low > 0.0 for one in fits) <= 10  # 1.1 % expected
    assert all((one.direction_error_deg == 180.0) == (one.low == 0.0) for one in fits)
    with pytest.raises(NotIdentified, match="turn over a whole circle"):
        fit_transverse(np.ones(8), np.zeros(8), np.zeros(8), np.full(8, 1e-5))


def test_a_phase_that_differs_between_records_leaves_no_trace_in_the_transverse_output(rng):
    angle = np.radians(np.arange(0.0, 360.0, 30.0))
    along = 0.06 * np.exp(1.0j)  # motion of the exciter on the sensitive axis, out of phase
    columns = [np.cos(angle), np.sin(angle), np.full(angle.size, along)]
    drive = np.asarray(2.0 * np.column_stack(columns), dtype=np.complex128)
    own = np.array([[1.002, 0.001, -0.003], [0.002, 0.998, 0.004], [0.0025, -0.0015, 1.001]])
    turn = rng.uniform(0.2, 0.3, angle.size) + 1e-3 * rng.normal(size=angle.size)
    answer: Any = np.exp(-1j * turn)[:, None] * (1.0 + 1e-3 * rng.normal(size=angle.size))[:, None] * (drive @ own.T)
    factor = relative_phase(drive, answer)
    assert np.max(np.abs(np.angle(factor * np.exp(-1j * turn)))) < 2e-8
    ratio = np.real(answer[:, 2] * factor - drive[:, 2]) / 2.0
    fit = fit_transverse(np.cos(angle), np.sin(angle), ratio, np.full(angle.size, 5e-6))
    assert fit.value == pytest.approx(np.hypot(0.0025, 0.0015), abs=2e-5)
    common = np.exp(1j * np.angle(np.sum(np.conj(drive[:, :2]) * answer[:, :2])))
    apart = np.real(answer[:, 2] * np.conj(common) - drive[:, 2]) / 2.0
    assert abs(fit_transverse(np.cos(angle), np.sin(angle), apart, np.full(angle.size, 5e-6)).value - 0.002915) > 1e-4
    with pytest.raises(NotIdentified, match="does not answer"):
        relative_phase(drive, 0.0 * answer)


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
