"""What the uncertainties of procedures take for noise: distortion of an exciter, wander between faces, scatter of a median."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from long_suites import mostly_slow
from scipy.stats import chi2

from inertial.dynamics.sine_fit import fit_tone_and_frequency
from inertial.dynamics.stability import short_noise
from inertial.dynamics.transfer_effects import Conditions
from inertial.dynamics.transfer_model import Points
from pipelines.procedures.ratiometry import RatiometryPart, over_supply
from pipelines.procedures.recorded import Device, UnitRecord, noise_columns
from pipelines.procedures.sweep_points import SweepPart, response_point
from pipelines.procedures.transfer_figures import figures_of_transfer
from stations.plant.noise import UnitNoise
from stations.plant.preset import load_preset

RATE, CYCLES_HZ = 6400.0, 100.0
SUPPLIES = (12.0, 10.0, 11.0, 12.5, 13.0)


def shaken(rng: np.random.Generator, distortion: float, noise: float, tone_hz: float = CYCLES_HZ) -> np.ndarray:
    """A tone of 1 g with a second harmonic, 0.2 s, (n,)."""
    turn = 2.0 * np.pi * tone_hz * np.arange(round(0.2 * RATE)) / RATE
    return np.cos(turn) + distortion * np.cos(2.0 * turn + 0.7) + noise * rng.normal(size=turn.size)


@pytest.mark.parametrize("distortion", mostly_slow([0.0, 0.03], 0.03))
def test_distortion_of_the_exciter_is_not_noise_of_a_frequency(distortion: float, rng: np.random.Generator) -> None:
    errors = []
    for _ in range(200):
        wave = shaken(rng, distortion, 1e-3, 100.03)[:, None]
        tone = fit_tone_and_frequency(wave, RATE, CYCLES_HZ, harmonics=5)
        assert tone.frequency_error == pytest.approx(np.sqrt(6.0 / len(wave)) / np.pi * 1e-3 / 0.2, rel=0.1)
        errors.append((tone.frequency - 100.03) / tone.frequency_error)
    low, high = np.sqrt(chi2.ppf([0.005, 0.995], 200) / 200)
    assert low < np.sqrt(np.mean(np.square(errors))) < high


def test_a_channel_that_stands_still_has_no_frequency() -> None:
    tone = fit_tone_and_frequency(np.zeros((1000, 1)), RATE, CYCLES_HZ, harmonics=5)
    assert (abs(tone.value[0]), tone.frequency_error) == (0.0, np.inf)


@pytest.mark.slow
def test_distortion_of_the_exciter_is_not_noise_of_a_point_of_a_sweep(rng: np.random.Generator) -> None:
    part = SweepPart(kind="sweep", repeatability_percent=0.0, repeatability_deg=0.0, transverse_percent=0.0)
    device = Device({}, {}, 50.0, "V")
    time = np.arange(round(0.2 * RATE)) / RATE
    pulls, sizes = [], []
    for _ in range(200):
        reference = np.zeros((time.size, 3))
        reference[:, 2] = shaken(rng, 0.03, 2e-4)
        output = np.zeros((time.size, 3))
        output[:, 2] = shaken(rng, 0.03, 1e-3)
        records = (UnitRecord(time, reference), UnitRecord(time, output))
        point = response_point(part, 0, {"frequency_hz": CYCLES_HZ}, records, 2, (0.0, 0.0), device)
        errors = point["uncertainty"], point["phase_uncertainty_deg"]
        pulls.append(((point["value"] - 1.0) / errors[0], point["phase_deg"] / errors[1]))
        sizes.append(point["uncertainty"])
    assert np.median(sizes) == pytest.approx(np.hypot(1e-3, 2e-4) * np.sqrt(2.0 / time.size), rel=0.05)
    low, high = np.sqrt(chi2.ppf([0.005, 0.995], 200) / 200)
    squares = np.sqrt(np.mean(np.square(pulls), axis=0))
    assert np.all((low < squares) & (squares < high)), squares


@pytest.mark.slow
def test_the_sensitivity_over_the_supply_has_the_wander_from_face_to_face() -> None:
    """A device whose flicker is the largest part of the noise, both faces at once for each of five voltages."""
    units, rate, dwell, move = 70, 50.0, 10.0, 6.0
    noise = UnitNoise(load_preset("SF1500"), [np.random.default_rng([17, k]) for k in range(units)])
    rows: list[list[dict[str, float]]] = [[] for _ in range(3 * units)]
    time = 0.0
    for volt in SUPPLIES:
        for side, force in enumerate((1.0, -1.0)):
            noise.jump(move)
            time += move
            record = force + noise.sample(round(dwell * rate), rate).reshape(round(dwell * rate), -1)
            for own, output in zip(rows, record.T, strict=True):
                face = {
                    "setting": volt, "side": float(side), "value": float(output.mean()), "measured_V": volt,
                    "uncertainty": float(output.std(ddof=1) / np.sqrt(output.size)),
                    "window_s": dwell, "time_s": time + 0.5 * dwell,
                }  # fmt: skip
                own.append(face | noise_columns(short_noise(output, rate)))
            time += dwell
    part = RatiometryPart(kind="ratiometry", supplies_V=list(SUPPLIES), axes=["z"])
    curves = [over_supply(part, pd.DataFrame(own)) for own in rows]
    pulls = np.array([one.sensitivity[1:] / one.sensitivity_error[1:] for one in curves])
    low, high = np.sqrt(chi2.ppf([0.005, 0.995], len(pulls) - 1) / (len(pulls) - 1))
    assert np.all((low < pulls.std(axis=0, ddof=1)) & (pulls.std(axis=0, ddof=1) < high)), pulls.std(axis=0, ddof=1)


def test_flatness_has_the_scatter_of_a_median(rng: np.random.Generator) -> None:
    """Seven points give the magnitude at low frequency by their median, which scatters more than their mean."""
    frequency = 10.0 * 2.0 ** (np.arange(37) / 4.0)
    size = np.where(frequency > 400.0, 0.99, 1.0)
    error = np.where(frequency > 400.0, 1e-5, 1e-3)  # the scatter is that of the low points
    conditions = Conditions(frequency, np.ones(37), np.full(37, 25.0), np.full(37, 0.2))
    part: Any = SimpleNamespace(axis="z", flat_to_hz=460.0, nominal_scale=1.0, reference_percent=0.25)
    extended = SimpleNamespace(sensitivity=1.0, sensitivity_error=1e-3)
    lost: Any = SimpleNamespace(extended=extended, adequate=None, reason="no model", unexplained=False)
    pulls = []
    for _ in range(1000):
        value = np.asarray(size * (1.0 + error * rng.normal(size=37)), dtype=np.complex128)
        figures = figures_of_transfer(part, lost, Points(conditions, value, error, error), None)
        flatness = next(one for one in figures if one.figure == "sweep_flatness_percent")
        pulls.append((flatness.value + 1.0) / flatness.uncertainty)
    low, high = np.sqrt(chi2.ppf([0.005, 0.995], 999) / 999)
    assert low < np.std(pulls, ddof=1) < high
    part.flat_to_hz = None  # without a band the roll-off itself would be the largest departure
    figures = figures_of_transfer(part, lost, Points(conditions, value, error, error), None)
    assert not next(one for one in figures if one.figure == "sweep_flatness_percent").identified
