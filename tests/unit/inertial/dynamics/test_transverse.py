"""Transverse sensitivity and tones: limits, phases and distortion."""

from typing import Any

import numpy as np
import pytest

from inertial.dynamics.sine_fit import fit_tone
from inertial.dynamics.transverse import fit_transverse, relative_phase
from inertial.errors import NotIdentified


def test_no_transverse_sensitivity_gives_an_upper_limit_and_no_direction(rng: np.random.Generator) -> None:
    angle = np.radians(np.arange(0.0, 360.0, 45.0))
    fits = [
        fit_transverse(np.cos(angle), np.sin(angle), 1e-5 * rng.normal(size=8), np.full(8, 1e-5)) for _ in range(300)
    ]
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


def test_distortion_is_no_noise_of_a_tone() -> None:
    time = np.arange(2000) / 10_000.0
    wave = np.cos(2.0 * np.pi * 80.0 * time) + 0.03 * np.cos(2.0 * np.pi * 160.0 * time + 0.7)
    plain, whole = (fit_tone(wave[:, None], 10_000.0, 80.0, harmonics=k) for k in (1, 5))
    assert plain.sigma[0] == pytest.approx(0.03 / np.sqrt(2.0), rel=1e-2)
    assert whole.sigma[0] < 1e-12
    assert whole.value[0] == pytest.approx(1.0, abs=1e-12)
