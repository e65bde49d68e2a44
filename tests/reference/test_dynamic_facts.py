"""Reference values of dynamic tests: published, or computed once by another route (exact integrals, simulation)."""

import numpy as np
import pytest
from each import each
from scipy.signal import lsim

from inertial.dynamics import centrifuge, pulses, sine_fit, spectra, stability, tilt
from inertial.errors import NotIdentified
from schemas.vibration_profile import load_vibration_profile, vibration_profiles


def test_band_edges_of_a_second_order_sensor() -> None:
    edges = {0.5: 1.272, 0.6: 1.148, 0.65: 1.080, 0.7: 1.010, 0.7071: 1.000, 0.75: 0.940, 0.8: 0.871, 1.0: 0.644}
    assert {zeta: spectra.bandwidth(1.0, zeta) for zeta in edges} == pytest.approx(edges, abs=6e-4)


SEVERITIES = {
    (5, 30): 0.94, (15, 11): 1.03, (30, 18): 3.37, (50, 11): 3.43, (50, 3): 0.94, (100, 6): 3.75, (100, 11): 6.87,
    (500, 1): 3.12, (1000, 1): 6.24, (1500, 0.5): 4.68, (3000, 0.2): 3.75,
}  # fmt: skip


def test_velocity_change_of_the_severities_of_iec_60068_2_27() -> None:
    made = {(peak, ms): pulses.velocity_change(peak, 1e-3 * ms) for peak, ms in SEVERITIES}
    assert made == pytest.approx(SEVERITIES, abs=6e-3)


def test_the_peak_of_a_noisy_pulse_is_not_its_largest_sample(rng: np.random.Generator) -> None:
    rate, duration = 20_000.0, 0.011
    t = np.arange(2000) / rate
    clean = np.where((t > 0.03) & (t < 0.041), 50.0 * np.sin(np.pi * (t - 0.03) / duration), 0.0)
    largest, parabola = [], []
    for _ in range(200):
        record = clean + 0.5 * rng.normal(size=t.size)
        largest.append(record.max() - 50.0)
        parabola.append(pulses.measured_pulse(record, rate, before_s=0.025))
    errors = np.array([p.peak - 50.0 for p in parabola])
    assert np.mean(largest) == pytest.approx(0.82, abs=0.12)
    assert abs(np.mean(errors)) < 0.06
    assert np.std(errors) / np.mean([p.peak_error for p in parabola]) == pytest.approx(1.0, abs=0.2)
    assert np.mean([p.duration_s for p in parabola]) == pytest.approx(duration, rel=0.01)


SRS = {
    np.inf: (0.3963, 0.7705, 1.5708, 1.7683, 1.7320, 1.5000, 1.2681, 1.1699, 1.0998, 1.0497),
    10.0: (0.3691, 0.7176, 1.4626, 1.6510, 1.6238, 1.4213, 1.2124, 1.1016, 1.0430, 1.0112),
}


@pytest.mark.parametrize("q", SRS)
def test_shock_response_spectrum_of_the_half_sine(q: float) -> None:
    products = np.array([0.1, 0.2, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0])
    duration, rate = 1.0, 4000.0
    t = np.arange(int(duration * rate) + 1) / rate
    spectrum = pulses.shock_spectrum(np.sin(np.pi * t / duration), rate, products / duration, q)
    assert spectrum == pytest.approx(SRS[q], abs=6e-4)


def test_the_recursion_is_exact_for_straight_segments() -> None:
    rate, f, q = 500.0, 40.0, 10.0
    x = np.random.default_rng(4).normal(size=200)
    x[0] = 0.0
    wn, zeta = 2.0 * np.pi * f, 0.5 / q
    system = ([2.0 * zeta * wn, wn**2], [1.0, 2.0 * zeta * wn, wn**2])
    assert pulses.responses(x, rate, f, q) == pytest.approx(lsim(system, x, np.arange(200) / rate)[1], abs=1e-9)


def test_the_largest_response_and_the_undamped_residual() -> None:
    x = np.linspace(0.79, 0.85, 61)
    t = np.arange(0, 1.0 + 1e-9, 1 / 2000.0)
    largest_at = {np.inf: (1.7685, 0.810), 25.0: (1.7184, 0.816), 10.0: (1.6516, 0.823), 5.0: (1.5584, 0.834)}
    for q, (largest, place) in largest_at.items():
        spectrum = pulses.shock_spectrum(np.sin(np.pi * t), 2000.0, x, q)
        assert spectrum.max() == pytest.approx(largest, abs=3e-4)
        assert x[int(np.argmax(spectrum))] == pytest.approx(place, abs=0.004)
    with pytest.raises(NotIdentified, match="sample faster"):
        pulses.shock_spectrum(np.ones(10), 100.0, np.array([20.0]))


def test_sine_fit_variances(rng: np.random.Generator) -> None:
    n, rate, f = 400, 1000.0, 37.3
    t = np.arange(n) / rate
    clean = np.cos(2 * np.pi * f * t + 0.4)[:, None]
    tones = np.array([sine_fit.fit_tone(clean + 0.1 * rng.normal(size=(n, 1)), rate, f).value[0] for _ in range(1000)])
    amplitude, phase = np.abs(tones), np.angle(tones)
    assert np.std(amplitude) / (0.1 * np.sqrt(2 / n)) == pytest.approx(0.996, abs=0.05)
    assert np.std(phase) / (0.1 * np.sqrt(2 / n)) == pytest.approx(1.007, abs=0.05)
    assert np.mean(phase) == pytest.approx(0.4, abs=1e-3)
    t = np.arange(3000) / 1000.0
    record = (np.sin(2 * np.pi * t) + 0.5 * t / 3.0)[:, None]  # the linear term takes a drift out
    assert abs(sine_fit.fit_tone(record, 1000.0, 1.0).value[0]) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
def test_a_wrong_frequency_lowers_the_amplitude_and_the_fourth_parameter_repairs_it(rng: np.random.Generator) -> None:
    rate, f = 10_000.0, 1000.0
    t = np.arange(10_000) / rate
    for share, low in ((0.05, -0.0041), (0.1, -0.016), (0.2, -0.065)):
        record = np.cos(2 * np.pi * (f + share) * t)[:, None]
        assert abs(sine_fit.fit_tone(record, rate, f).value[0]) - 1.0 == pytest.approx(low, rel=0.06)
    ppm = 1000.0
    record = (np.cos(2 * np.pi * f * (1 + 1e-6 * ppm) * t) + 0.01 * rng.normal(size=t.size))[:, None]
    assert abs(sine_fit.fit_tone(record, rate, f).value[0]) < 0.01
    errors = []
    for _ in range(40):
        noisy = np.cos(2 * np.pi * f * (1 + 1e-6 * ppm) * t)[:, None] + 0.1 * rng.normal(size=(t.size, 1))
        tone = sine_fit.fit_tone_and_frequency(noisy, rate, f)
        errors.append((tone.frequency - f * (1 + 1e-6 * ppm)) / tone.frequency_error)
        assert abs(tone.value[0]) == pytest.approx(1.0, abs=0.01)
    assert 0.7 < np.std(errors) < 1.35
    assert tone.frequency_error == pytest.approx(np.sqrt(6.0 / t.size) / np.pi * 0.1, rel=0.05)  # √6/π·(σ/A)/(T√N)


def test_confidence_of_a_density_what_is_folded_and_limits_of_the_exciter() -> None:
    for n, low, high in ((60, -2.3, 1.9), (120, -1.6, 1.3), (240, -1.1, 1.0)):
        assert spectra.density_confidence(n / 2.0) == pytest.approx((low, high), abs=0.13)
    for times, second, one in ((5, -24, -12), (10, -38, -19), (20, -51, -26)):
        folded = [20 * np.log10(spectra.folded_share(times, 1.0, order)) for order in (2, 1)]
        assert folded == pytest.approx([second, one], abs=0.6)
    for stroke, start in ((0.005, 15.8), (0.0127, 9.9), (0.0254, 7.0)):
        level = spectra.largest_level(start, displacement_m=stroke, velocity_m_s=10.0, acceleration_g=50.0)
        assert level == pytest.approx(5.0, rel=0.01)


def test_overall_level_and_the_hann_mean(rng: np.random.Generator) -> None:
    flat = np.array([20.0, 2000.0]), np.array([0.03, 0.03])
    target = spectra.interpolated(np.fft.rfftfreq(16_000, 1.0 / 8000.0).clip(1e-12), *flat)
    z = rng.standard_normal((60, 2, target.size))
    made = np.fft.irfft(np.sqrt(target * 8000.0 * 4000.0) * (z[:, 0] + 1j * z[:, 1]), 16_000)[:, 4000:12_000]
    assert np.std(made) == pytest.approx(spectra.overall_level(*flat), rel=0.01)
    assert np.std([spectra.hann_mean(one[:, None])[0] for one in made]) < 3e-5
    assert np.std(made.mean(axis=1)) > 3e-3


def test_centrifuge_relations() -> None:
    x = np.linspace(0.1, 1.0, 10)
    for largest, k2, k3 in ((1.0, 69, 127), (10.0, 0.69, 0.13), (100.0, 0.0069, 0.00013)):
        a = np.concatenate([x, -x]) * largest
        estimate = centrifuge.fit_polynomial(a, a, np.full(20, 1e-4), centrifuge.TERMS[:4])
        assert 1e6 * estimate.of("second_order")[1] == pytest.approx(k2, rel=0.35)
        assert 1e6 * estimate.of("third_order")[1] == pytest.approx(k3, rel=0.35)
    for terms, value in (((0.0, 1.0, 1.0, 0.0), 66.7), ((0.0, 1.0, 0.0, 1.0), 38.5)):  # by the least-squares line
        p = centrifuge.Polynomial(centrifuge.TERMS[:4], np.array(terms), np.eye(4), np.zeros(1), 0.0, 1)
        assert centrifuge.linearity_percent(p, 1.0) == pytest.approx(value, rel=0.05)


def test_one_plane_of_tilt_gives_the_known_uncertainties() -> None:
    for n, first, more in ((12, (0.29, 0.41), (0.50, 1.29, 0.82, 1.63)), (24, (0.20, 0.29), (0.35, 0.91, 0.58, 1.15))):
        angle = 2 * np.pi * np.arange(n) / n
        plain = tilt.fit_tilt(angle, np.sin(angle), np.ones(n))
        assert (plain.of("bias")[1], plain.scale[1]) == pytest.approx(first, abs=6e-3)
        assert plain.phase[1] == pytest.approx(first[1], abs=6e-3)
        whole = tilt.fit_tilt(angle, np.sin(angle), np.ones(n), orders=3)
        uncertainties = (whole.of("bias")[1], whole.scale[1], whole.of("second_order")[1], whole.of("third_order")[1])
        assert uncertainties == pytest.approx(more, abs=0.01)
    angle = 2 * np.pi * np.arange(24) / 24
    fit = tilt.fit_tilt(angle, np.sin(angle) + 1e-3 * np.sin(angle) ** 3, np.ones(24))
    assert fit.scale[0] - 1.0 == pytest.approx(0.75e-3, rel=1e-6)  # a cubic raises the scale by three quarters
    assert fit.residuals == pytest.approx(-0.25e-3 * np.sin(3 * angle), abs=1e-12)


def test_definitions_of_bias_stability_differ(rng: np.random.Generator) -> None:
    names = ("range_1s", "sd_1s", "sd_100s", "range_100s", "allan_100s")
    records = [stability.stability(10.0 * rng.normal(size=3600), 1.0) for _ in range(40)]
    white = np.array([[getattr(one, name) for name in names] for one in records]).mean(axis=0)
    assert white == pytest.approx([72, 10, 1.0, 4.2, 1.0], rel=0.06)
    ramp = stability.stability(50.0 * np.arange(3600) / 3600.0, 1.0)
    assert (ramp.range_1s, ramp.sd_100s, ramp.range_100s) == pytest.approx((50, 14.6, 49), rel=0.02)
    assert ramp.drift_h == pytest.approx(50.0, rel=1e-3)
    assert ramp.allan_100s == pytest.approx(1.0, rel=0.03)


def test_warm_up_time_of_an_exponential() -> None:
    t = np.arange(0.0, 6000.0)
    time, _ = stability.warm_up_time(t, 1000.0 * np.exp(-t / 300.0), band=50.0, window_s=1.0)
    assert time == pytest.approx(899.0, abs=2.0)
    with pytest.raises(NotIdentified, match="record longer"):
        stability.warm_up_time(t[:800], 1000.0 * np.exp(-t[:800] / 300.0), band=5.0, window_s=1.0)


def test_own_error_of_the_cycles_is_removed(rng: np.random.Generator) -> None:
    cycles = 20.0 * rng.normal(size=(2000, 10)) + 15.0 * rng.normal(size=(2000, 10))
    estimates = [stability.repeatability(own, 15.0) for own in cycles]
    assert np.mean([one.value == 0.0 for one in estimates]) == pytest.approx(0.05, abs=0.03)
    assert np.sqrt(np.mean([one.value**2 for one in estimates])) == pytest.approx(20.0, rel=0.06)
    assert np.mean([one.low <= 20.0 <= one.high for one in estimates]) == pytest.approx(0.95, abs=0.03)


OVERALL = {
    "flat_20_2000": 8.90, "mil_std_810_truck_vertical": 1.043, "mil_std_810_truck_transverse": 0.2035,
    "mil_std_810_truck_longitudinal": 0.7402, "navmat_p9492": 6.06, "gevs_qualification": 14.14, "gevs_acceptance": 10.00,
    "do160_curve_c": 4.13, "do160_curve_d1": 7.95, "rideshare_2022": 5.57, "astm_d4169_truck_2": 0.517,
    "iec_60721_3_2_2m4": 3.284,  # √(10 + 21.92 + 10 + 20.53 + 975) m/s²: the bands and the lines between them, by hand
}  # fmt: skip


@each(OVERALL)
def test_overall_level_of_the_profiles(name: str) -> None:
    assert set(OVERALL) == set(vibration_profiles())
    points = np.array(load_vibration_profile(name).breakpoints)
    assert spectra.overall_level(points[:, 0], points[:, 1]) == pytest.approx(OVERALL[name], rel=2e-3)
    fine = np.geomspace(points[0, 0], points[-1, 0], 200_001)
    by_sum = np.trapezoid(spectra.interpolated(fine, points[:, 0], points[:, 1]), fine)
    assert np.sqrt(by_sum) == pytest.approx(OVERALL[name], rel=2e-3)
