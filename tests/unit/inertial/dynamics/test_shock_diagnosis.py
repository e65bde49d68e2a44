"""Shock: hidden effects, made by scipy, are named in their class; nothing is named without."""

import numpy as np
import pytest
from long_suites import mostly_slow
from scipy import signal

from inertial.dynamics.shock_diagnosis import ShockRecord, Waves, diagnose_shock

FINE = 200e3
DURATION, RATE, BEFORE, AFTER = 0.011, 40 / 0.011, 0.015, 0.08
FLOOR = 0.02  # g, of a pulse of 30 g


def filtered(wave: np.ndarray, corner: float) -> np.ndarray:
    b, a = signal.butter(2, corner, fs=FINE)
    return signal.lfilter(b, a, wave)


def shock_of(hidden: str, size: float, rng: np.random.Generator, signs=(1.0, -1.0)) -> ShockRecord:
    """Shocks whose unit has a hidden effect that is made at 200 kHz, and noise on every sample of the comparison."""
    shocks = []
    time = np.arange(round((BEFORE + DURATION + AFTER) * FINE)) / FINE - BEFORE
    for sign in signs:
        peak, length = 30.0 * (1.0 + 0.05 * rng.normal()), DURATION * (1.0 + 0.03 * rng.normal())
        true = np.where((time > 0) & (time < length), sign * peak * np.sin(np.pi * time / length), 0.0)
        true = filtered(true, 6.0 / DURATION)
        unit, reference = true.copy(), true.copy()
        if hidden == "filter_of_unit":
            unit = filtered(unit, size)
        elif hidden == "filter_of_reference":
            reference = filtered(reference, size)
        elif hidden == "ac_coupled_reference":
            b, a = signal.butter(1, 1.0 / (2.0 * np.pi * size), btype="high", fs=FINE)
            reference = signal.lfilter(b, a, reference)
        elif hidden == "zero_shift":
            unit = unit + size * (time > 0.5 * length)
        elif hidden == "third_order":
            unit = unit + size * unit**3
        elif hidden == "mounting_resonance":
            w = 2.0 * np.pi * size
            system = signal.cont2discrete(([0.06 / w, 1.0], [1.0 / w**2, 0.06 / w, 1.0]), 1.0 / FINE, method="foh")
            unit = signal.lfilter(system[0].ravel(), system[1], unit)
        at = np.arange(time[0] + 1e-3, time[-1], 1.0 / RATE)
        unit, reference = np.interp(at - 120e-6, time, unit), np.interp(at, time, reference)
        shocks.append(Waves(reference, unit + FLOOR * rng.normal(size=at.size), np.full(at.size, FLOOR)))
    return ShockRecord(RATE, DURATION, BEFORE - 1e-3, tuple(shocks))


HIDDEN = {
    "filter_of_unit": 350.0, "filter_of_reference": 350.0, "ac_coupled_reference": 2.0, "zero_shift": 0.05,
    "third_order": 5e-6, "mounting_resonance": 400.0,
}  # fmt: skip


@pytest.mark.parametrize("hidden", mostly_slow(HIDDEN, "third_order", "zero_shift"))
def test_a_hidden_effect_of_a_shock_is_named_and_samples_left_out_are_predicted_better(hidden: str, rng) -> None:
    diagnosis = diagnose_shock(shock_of(hidden, HIDDEN[hidden], rng))
    assert diagnosis.adequate is False
    assert hidden in diagnosis.classes[0].effects
    assert diagnosis.left_out[1] == pytest.approx(1.0, abs=0.2)
    assert diagnosis.left_out[0] > 1.04


@pytest.mark.slow
def test_shocks_in_one_direction_do_not_tell_an_ac_coupled_reference_from_a_zero_shift(rng) -> None:
    one, both = (diagnose_shock(shock_of("ac_coupled_reference", 2.0, rng, signs)) for signs in ((1.0,), (1.0, -1.0)))
    assert {"ac_coupled_reference", "zero_shift"} <= set(one.classes[0].effects)
    assert any("other direction" in text for text in one.next_steps)
    assert {"ac_coupled_reference", "zero_shift"} & set(both.classes[0].effects) == {"ac_coupled_reference"}
    assert both.extended.parameters["coupling_s"][0] == pytest.approx(2.0, rel=0.1)


def test_nothing_is_named_in_shocks_without_a_hidden_effect(rng) -> None:
    diagnoses = [diagnose_shock(shock_of("none", 0.0, rng)) for _ in range(20)]
    assert all(one.adequate for one in diagnoses)
    sensitivity = [(one.fit.sensitivity - 1.0) / one.fit.sensitivity_error for one in diagnoses]
    assert np.std(sensitivity) < 1.6
