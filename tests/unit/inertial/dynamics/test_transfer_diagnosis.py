"""Diagnosis of a transfer function: what a sweep can know, and effects that are hidden by other means than they are fitted."""

from dataclasses import replace

import numpy as np
import pytest
from each import each
from long_suites import mostly_slow
from scipy import signal

from inertial.dynamics.spectra import transfer
from inertial.dynamics.transfer_diagnosis import diagnose_transfer
from inertial.dynamics.transfer_effects import EFFECTS, Conditions
from inertial.dynamics.transfer_model import Points, _one_sided_steps, factor_of, fit_transfer


def points(f: np.ndarray, h: np.ndarray, share: float, phase: float, rng: np.random.Generator | None = None) -> Points:
    n = f.size
    noise = 0.0 if rng is None else share * rng.normal(size=n) + 1j * phase * rng.normal(size=n)
    c = Conditions(f, np.ones(n), np.full(n, 25.0), np.ones(n))
    return Points(c, h * np.exp(noise), np.full(n, share), np.full(n, phase))


def with_off(one: Points, **off: complex) -> Points:
    """The points with some of them, p0 and so on, multiplied by a factor."""
    value = one.value.copy()
    for name, factor in off.items():
        value[int(name[1:])] *= factor
    return replace(one, value=value)


def low_passed(f: np.ndarray, order: int, corner: float) -> np.ndarray:
    return signal.freqs(*signal.butter(order, 2.0 * np.pi * corner, analog=True), 2.0 * np.pi * f)[1]


def octaves(count: int) -> np.ndarray:
    """Frequencies of sixths of an octave from 5 Hz on."""
    return 5.0 * 2.0 ** (np.arange(count) / 6.0)


KNOWN = [  # up to, Hz; uncertainty of natural frequency and damping with the delay known, and with it fitted
    (1000.0, (0.013, 0.010), (0.11, 0.011)),
    (2000.0, (0.0034, 0.003), (0.015, 0.004)),
    (5000.0, (0.0011, 0.0014), (0.0020, 0.0018)),
]


@each(KNOWN)
def test_what_a_sweep_can_know(row: tuple) -> None:
    top, known, fitted = row
    f = octaves(int(6.0 * np.log2(top / 5.0)) + 1)
    one = points(f, -transfer(f, 2500.0, 0.7), 0.005, np.radians(0.3))
    for effects, expected in ((("second_order",), known), (("second_order", "delay"), fitted)):
        fit = fit_transfer(one, effects)
        assert fit.errors[0] == pytest.approx(expected[0], rel=0.06)
        assert fit.of("damping")[1] == pytest.approx(expected[1], rel=0.2, abs=2e-4)


@each(EFFECTS)
def test_several_models_at_once_are_the_models_each_alone(effect: str, rng: np.random.Generator) -> None:
    f = np.geomspace(5.0, 5000.0, 12)
    state = (np.linspace(*ends, 12) for ends in ((1.0, 2.0), (10.0, 40.0), (1.0, 1.0), (500.0, 1013.0)))
    c = Conditions(f, *state)
    model = ("second_order", *({effect} - {"second_order"}))
    parameters = [p for name in model for p in EFFECTS[name].parameters(c)]
    values = np.array([[rng.choice(p.starts) for p in parameters] for _ in range(5)])
    at_once = factor_of(model, c)(values.T[..., None])
    np.testing.assert_array_equal(at_once, [factor_of(model, c)(row) for row in values])


def test_slopes_at_a_bound_and_within_narrow_bounds_are_those_of_points_inside() -> None:
    x, low, high = np.array([(0.0, -1.0, 1.0), (2.0, 0.0, 2.0), (-3.0, -3.0, 0.0), (1.0, 1.0 - 1e-9, 1.0)]).T
    steps = _one_sided_steps(x, low, high)
    assert np.all((x + steps >= low) & (x + steps <= high) & (steps != 0.0))
    assert steps[0] > 0.0  # away from zero where both sides are free


@pytest.mark.parametrize("kind", mostly_slow(["two_pole", "moving_average", "one_pole"], "one_pole"))
def test_a_hidden_low_pass_is_named_and_the_error_falls(kind: str, rng: np.random.Generator) -> None:
    f = np.geomspace(5.0, 5000.0, 45)
    h = -transfer(f, 2300.0, 0.62) * np.exp(-2j * np.pi * f * 2e-5)
    if kind == "moving_average":
        h = h * signal.freqz(np.ones(160) / 160, worN=f, fs=1e6)[1]
    else:
        h = h * low_passed(f, 2 if kind == "two_pole" else 1, 5000.0)
    diagnosis = diagnose_transfer(points(f, h, 2e-3, 2e-3, rng))
    assert diagnosis.adequate is False
    assert kind in diagnosis.classes[0].effects
    assert diagnosis.extended_percent < 0.5 * diagnosis.error_percent
    assert diagnosis.left_out[1] == pytest.approx(1.0, abs=0.3)
    assert diagnosis.where[0].high_hz == pytest.approx(5000.0)


@pytest.mark.parametrize("mode", mostly_slow([1166.0, 2865.0, 1910.0], 1166.0))
def test_a_mode_so_narrow_that_one_point_meets_it_is_named_by_its_skirts(mode: float, rng: np.random.Generator) -> None:
    """Points are 12 % apart and the mode is 6 % wide: at its peak no other point predicts it."""
    f = np.geomspace(5.0, 5000.0, 60)
    h = transfer(f, 2500.0, 0.62) * (1.0 - signal.freqs([0.0043, 0, 0], [1, 0.06, 1], f / mode)[1])
    diagnosis = diagnose_transfer(points(f, h, 2e-3, 2e-3, rng))
    assert (diagnosis.recommended, diagnosis.alone_hz) == (("second_mode",), ())
    assert diagnosis.extended.of("mode_hz")[0] == pytest.approx(mode, rel=0.02)
    before, after = diagnosis.left_out
    assert after == pytest.approx(1.0, abs=0.25)
    assert before > 1.6 * after


@pytest.mark.parametrize("seed", mostly_slow([1, 2, 3, 4, 5, 6], 2))
def test_a_point_that_is_off_is_a_bad_point_and_no_effect(seed: int) -> None:
    rng = np.random.default_rng([seed, 817])
    f = np.geomspace(5.0, 5000.0, 60)
    one = points(f, transfer(f, 2300.0, 0.65) * np.exp(-2j * np.pi * f * 2e-5), 2e-3, 2e-3, rng)
    bad = int(rng.integers(60))
    factor = np.exp(rng.uniform(16e-3, 80e-3) * np.exp(2j * np.pi * rng.uniform()))
    diagnosis = diagnose_transfer(with_off(one, **{f"p{bad}": factor}))
    assert (diagnosis.adequate, diagnosis.classes) == (False, ())
    assert diagnosis.unexplained
    assert diagnosis.next_hz == diagnosis.alone_hz == (pytest.approx(f[bad]),)


@pytest.mark.slow
def test_bad_points_beside_a_hidden_low_pass_and_beside_each_other_are_told(rng: np.random.Generator) -> None:
    f = np.geomspace(5.0, 5000.0, 60)
    one = points(f, transfer(f, 2300.0, 0.62) * low_passed(f, 1, 9000.0), 2e-3, 2e-3, rng)
    diagnosis = diagnose_transfer(with_off(one, p20=1.08))
    assert diagnosis.alone_hz == (pytest.approx(f[20]),)
    assert "one_pole" in diagnosis.classes[0].effects
    f = np.geomspace(5.0, 4000.0, 45)
    diagnosis = diagnose_transfer(with_off(points(f, transfer(f, 1500.0, 0.62), 1e-3, 1e-3, rng), p20=1.03, p36=0.96))
    assert diagnosis.alone_hz == (pytest.approx(f[20]), pytest.approx(f[36]))
    assert diagnosis.classes == ()


@pytest.mark.slow
@pytest.mark.parametrize("scale", [2.0, 3.0, 5.5])
def test_uncertainties_that_are_too_small_make_no_points_bad(scale: float, rng: np.random.Generator) -> None:
    f = np.geomspace(5.0, 5000.0, 60)
    one = points(f, transfer(f, 2300.0, 0.65), 2e-3, 2e-3, rng)
    stated = replace(one, magnitude_error=one.magnitude_error / scale, phase_error=one.phase_error / scale)
    diagnosis = diagnose_transfer(stated)
    assert (diagnosis.adequate, diagnosis.alone_hz, diagnosis.classes) == (False, (), ())


@pytest.mark.parametrize("sweeps", mostly_slow([1, 5], 1))
def test_nothing_is_named_where_nothing_is_missing_and_few_points_cannot_be_judged(
    sweeps: int, rng: np.random.Generator
) -> None:
    f = np.geomspace(5.0, 4000.0, 40)
    h = -transfer(f, 2500.0, 0.7) * np.exp(-2j * np.pi * f * 3e-5)
    diagnoses = [diagnose_transfer(points(f, h, 2e-3, 2e-3, rng)) for _ in range(sweeps)]
    assert [(one.adequate, one.classes) for one in diagnoses] == [(True, ())] * sweeps
    few = np.geomspace(5.0, 4000.0, 4)
    diagnosis = diagnose_transfer(points(few, -transfer(few, 2500.0, 0.7), 2e-3, 2e-3))
    assert diagnosis.adequate is None
    assert "sweep more frequencies" in diagnosis.reason


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_mass_and_low_pass_are_not_exchanged_and_nothing_else_is_named(seed: int) -> None:
    """The exchanged solution is another minimum of the fit; from there further effects seem to be missing."""
    rng, f, error = np.random.default_rng(seed), octaves(56), 1e-3
    truth = transfer(f, 2215.6, 0.586) * low_passed(f, 2, 950.5) * np.exp(-4.8e-6j * np.pi * f)
    value = truth * np.exp(error * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)))
    diagnosis = diagnose_transfer(points(f, value, error, error), ("second_order", "delay"))
    assert diagnosis.recommended == ("two_pole",)
    natural, spread, *_ = diagnosis.extended.of("natural_hz")
    assert abs(natural - 2215.6) < 5.0 * spread
    assert spread < 10.0


def filtered(f: np.ndarray, corner: float) -> np.ndarray:
    """A mass of 2475 Hz behind which a two-pole low-pass and a delay follow, as in digital sensors."""
    return transfer(f, 2475.0, 0.7) * low_passed(f, 2, corner)


def test_a_sweep_to_1_khz_states_no_natural_frequency_of_a_mass_behind_a_low_pass(rng: np.random.Generator) -> None:
    """Mass with low-pass looks like a mass of 1.5 kHz with a delay: an adequate model is not the only one."""
    f = octaves(46)
    diagnosis = diagnose_transfer(points(f, filtered(f, 1581.0), 1e-3, 1e-3, rng), highest_hz=10000.0)
    natural = diagnosis.parameter("natural_hz")
    assert (diagnosis.adequate, natural.identified) == (True, False)
    assert natural.low < 2475.0 < natural.high
    assert natural.rival is not None
    assert max(diagnosis.next_hz) > 1000.0
    f = octaves(64)  # as is proposed
    natural = diagnose_transfer(points(f, filtered(f, 1581.0), 1e-3, 1e-3, rng)).parameter("natural_hz")
    assert natural.identified
    assert abs(natural.value - 2475.0) < 2.0 * natural.uncertainty < 100.0


@pytest.mark.slow
def test_frequencies_are_proposed_where_a_sensitivity_follows_the_temperature(rng: np.random.Generator) -> None:
    """The points that are planned next are all at one temperature, where the effect has nothing to follow."""
    f = octaves(46)
    warm = 25.0 + np.cumsum(rng.normal(size=f.size))
    one = points(f, filtered(f, 1581.0) * (1.0 + 2e-3 * (warm - warm.mean())), 1e-3, 1e-3, rng)
    conditions = replace(one.conditions, temperature=warm)
    diagnosis = diagnose_transfer(replace(one, conditions=conditions), highest_hz=10000.0)
    assert "temperature" in diagnosis.recommended
    assert not diagnosis.parameter("natural_hz").identified
    assert max(diagnosis.next_hz) > 1000.0


@each([(900.0, 0.05), (2406.0, 0.08), (1391.0, 0.42)])
def test_a_resonance_far_below_the_highest_frequency_is_found(row: tuple[float, float]) -> None:
    """The magnitude falls to 1 % there, and every start is off by hundreds of uncertainties."""
    f = octaves(67)
    fit = fit_transfer(points(f, transfer(f, *row), 1e-3, 1e-3), ("second_order", "delay"))
    assert (fit.of("natural_hz")[0], fit.of("damping")[0]) == (pytest.approx(row[0], 1e-4), pytest.approx(row[1], 1e-3))


@pytest.mark.parametrize("delay", mostly_slow([3e-4, 5e-4, 1e-3, 1.8e-3], 1e-3))
def test_a_delay_of_several_turns_of_the_phase_is_found(delay: float, rng: np.random.Generator) -> None:
    """The group delay of a converter's filter: the phase turns four times up to 4 kHz."""
    f = np.geomspace(5.0, 4000.0, 45)
    h = transfer(f, 1500.0, 0.62) * np.exp(-2j * np.pi * f * delay)
    diagnosis = diagnose_transfer(points(f, h, 2e-3, 2e-3, rng))
    assert diagnosis.adequate is True
    value, error, *_ = diagnosis.extended.of("delay_s")
    assert abs(value - delay) < 4.0 * error


def test_a_point_that_is_off_beside_an_adequate_sum_is_told(rng: np.random.Generator) -> None:
    f = np.geomspace(5.0, 4000.0, 60)
    one = points(f, transfer(f, 1500.0, 0.62), 2e-3, 2e-3, rng)
    diagnosis = diagnose_transfer(with_off(one, p22=1.0 + 7.0 * 2e-3))
    assert diagnosis.alone_hz == (pytest.approx(f[22]),)
    assert not diagnosis.unexplained
    assert diagnosis.parameter("damping").identified
