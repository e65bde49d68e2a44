"""Step records, departures over the supply, and transverse sensitivity: against scipy, closed forms and published values."""

from typing import Any

import numpy as np
import pytest
from scipy import signal

from inertial.dynamics import settling
from inertial.dynamics.ratiometry import departures, largest_departure, slope_over, zero_and_sensitivity
from inertial.dynamics.sine_fit import fit_tone
from inertial.dynamics.step_record import aligned, step_figures
from inertial.dynamics.transverse import fit_transverse, relative_phase
from inertial.errors import NotIdentified

PUBLISHED = {  # ω_n·t to stay within 2 %, 1 %, 0.1 % of the step, and overshoot in %: the facts' table
    0.6: (5.94, 6.26, 10.17, 9.5),
    0.7: (5.98, 6.58, 10.29, 4.6),
    0.75: (5.74, 6.60, 8.00, 2.8),
    0.8: (3.76, 6.35, 8.47, 1.5),
}
FAST = 2500.0


def recorded(zeta: float, noise: float = 0.0, seed: int = 0, natural: float = FAST):
    """A step by scipy at 200 kHz with white noise."""
    w = 2.0 * np.pi * natural
    time = np.arange(-100, 4000) / 200e3
    out = np.zeros(len(time))
    out[100:] = signal.step(([w**2], [1.0, 2.0 * zeta * w, w**2]), T=time[100:])[1]
    return time, out + noise * np.random.default_rng(seed).normal(size=len(time))


@pytest.mark.parametrize("zeta", PUBLISHED)
@pytest.mark.parametrize(("band", "which"), [(0.02, 0), (0.01, 1), (0.001, 2)])
def test_settling_and_overshoot_of_a_record_are_the_published_ones(zeta: float, band: float, which: int) -> None:
    time, out = recorded(zeta)
    figures = step_figures(time, out, np.full(len(time), 1e-6), band=band)
    assert figures.settling_s * 2.0 * np.pi * FAST == pytest.approx(PUBLISHED[zeta][which], abs=0.012)
    assert 100.0 * figures.overshoot == pytest.approx(PUBLISHED[zeta][3], abs=0.06)
    assert settling.damping_from_overshoot(figures.overshoot) == pytest.approx(zeta, abs=0.002)


def test_the_pulls_of_the_figures_have_unit_variance() -> None:
    time, clean = recorded(0.65)
    true = step_figures(time, clean, np.full(len(time), 1e-6), band=0.02)
    noise, pulls, known = 0.003, [], 0
    generator = np.random.default_rng(7)
    for _ in range(200):
        out = clean + noise * generator.normal(size=len(time))
        figures = step_figures(time, out, np.full(len(time), noise), band=0.02)
        known += figures.settling_identified
        pulls.append(
            (
                (figures.overshoot - true.overshoot) / figures.overshoot_error,
                (figures.settling_s - true.settling_s) / figures.settling_error_s,
                (figures.rise_s - true.rise_s) / figures.rise_error_s,
            )
        )
    assert known >= 190
    assert np.all(np.abs(np.std(pulls, axis=0, ddof=1) - 1.0) < 0.15)
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 0.35)


def test_an_extremum_at_the_edge_of_the_band_is_said_and_no_settling_time_is_stated() -> None:
    time, out = recorded(0.78, 5e-4, 3)  # overshoot 1.999 % beside a band of 2 %
    figures = step_figures(time, out, np.full(len(time), 5e-4), band=0.02)
    assert not figures.settling_identified
    assert figures.settling_low_s < 0.7 * figures.settling_high_s


def test_records_without_a_step_or_too_noisy_or_too_short_are_refused() -> None:
    time, out = recorded(0.7)
    with pytest.raises(NotIdentified, match="does not rise"):
        step_figures(time, 0.0 * out, np.full(len(time), 1e-4), band=0.02)
    with pytest.raises(NotIdentified, match="average more steps"):
        step_figures(time, out, np.full(len(time), 0.02), band=0.02)
    short = time < 3e-4
    with pytest.raises(NotIdentified, match="record longer"):
        step_figures(time[short], out[short], np.full(short.sum(), 1e-4), band=0.001)


def test_alignment_removes_the_blur_of_a_sampled_edge(rng: np.random.Generator) -> None:
    times, outs, late = [], [], rng.uniform(-1.0, 1.0, 16) * 10e-6
    for one in late:
        time = np.arange(-100, 900) / 50e3
        outs.append(settling.step_response(time + one, 2000.0, 0.7))
        times.append(time)
    joined = np.concatenate(aligned(times, outs))
    order = np.argsort(joined)
    true = settling.step_response(joined[order] + late.mean(), 2000.0, 0.7)
    assert np.max(np.abs(np.concatenate(outs)[order] - true)) < 0.004
    blurred = np.concatenate([settling.step_response(t + late.mean(), 2000.0, 0.7) for t in times])
    assert np.max(np.abs(np.concatenate(outs) - blurred)) > 0.03


def test_the_rise_time_is_right_where_the_points_lie_unevenly_about_the_crossings(rng: np.random.Generator) -> None:
    """Means over half a sample interval, as a procedure makes them of sixteen steps: the first above a level lies behind it."""
    rate, natural, zeta = 51.2e3, 1000.0, 0.7
    fine = np.linspace(0.0, 1e-3, 1_000_001)
    ten, ninety = np.interp([0.1, 0.9], settling.step_response(fine, natural, zeta), fine)
    errors = []
    for _ in range(24):
        times = np.concatenate([np.arange(-100, 900) / rate + late for late in rng.uniform(0.0, 1.0, 16) / rate])
        place = np.floor(times * rate * 2.0).astype(int) + 300
        count = np.bincount(place)
        sums = (np.bincount(place, weights=one) for one in (times, settling.step_response(times, natural, zeta)))
        middle, value = (one[count > 0] / count[count > 0] for one in sums)
        figures = step_figures(middle, value, np.full(middle.size, 1e-3), band=0.02, bin_s=0.5 / rate)
        errors.append(figures.rise_s / (ninety - ten) - 1.0)
    assert abs(np.mean(errors)) < 8e-5, errors


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


def test_no_transverse_sensitivity_gives_an_upper_limit_and_no_direction(rng: np.random.Generator) -> None:
    angle = np.radians(np.arange(0.0, 360.0, 45.0))
    fits = [
        fit_transverse(np.cos(angle), np.sin(angle), 1e-5 * rng.normal(size=8), np.full(8, 1e-5)) for _ in range(300)
    ]
    assert sum(one.low > 0.0 for one in fits) <= 10  # 1.1 % expected
    assert all((one.direction_error_deg == 180.0) == (one.low == 0.0) for one in fits)
    with pytest.raises(NotIdentified, match="turn over a whole circle"):
        fit_transverse(np.ones(8), np.zeros(8), np.zeros(8), np.full(8, 1e-5))


def test_a_phase_that_differs_between_records_leaves_no_trace_in_the_transverse_output(
    rng: np.random.Generator,
) -> None:
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


def test_distortion_is_no_noise_of_a_tone() -> None:
    time = np.arange(2000) / 10_000.0
    wave = np.cos(2.0 * np.pi * 80.0 * time) + 0.03 * np.cos(2.0 * np.pi * 160.0 * time + 0.7)
    plain, whole = (fit_tone(wave[:, None], 10_000.0, 80.0, harmonics=k) for k in (1, 5))
    assert plain.sigma[0] == pytest.approx(0.03 / np.sqrt(2.0), rel=1e-2)
    assert whole.sigma[0] < 1e-12
    assert whole.value[0] == pytest.approx(1.0, abs=1e-12)


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
def test_a_curve_symmetric_about_the_first_supply_has_its_departure_and_a_slope(
    supplies: tuple[float, ...], rng: np.random.Generator
) -> None:
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
