"""Recordings of dynamic tests as people have them: a swept sine or random vibration in one file, a shock of unknown duration."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from long_suites import mostly_slow
from scipy import signal

from pipelines.importers.inspection import inspect
from pipelines.importers.waveforms import RecordingLayout, import_waveforms
from schemas.errors import DataRejected, WrongUse

RATE_HZ = 10_000.0


def second_order(x, natural_hz, damping, rate_hz):
    """The answer of a mass on a spring by its differential equation."""
    w = 2.0 * np.pi * natural_hz
    return signal.lsim(([w**2], [1.0, 2.0 * damping * w, w**2]), x, np.arange(x.size) / rate_hz)[1]


def swept(rng):
    t = np.arange(int(2.0 * RATE_HZ)) / RATE_HZ
    return 0.5 * signal.chirp(t, 5.0, t[-1], 3000.0, method="log") * signal.windows.tukey(t.size, 0.02)


def shaken(rng):
    sos = signal.butter(4, 3000.0, fs=RATE_HZ, output="sos")
    return 0.5 * signal.sosfilt(sos, rng.standard_normal(int(2.0 * RATE_HZ)))


def written(path: Path, x, y, rng, noise_V):
    frame = {"time [s]": np.arange(x.size) / RATE_HZ, "ref [m/s^2]": 9.80665 * x}
    frame["out [V]"] = 0.02 + 0.1 * y + noise_V * rng.standard_normal(x.size)
    pd.DataFrame(frame).to_csv(path, index=False, float_format="%.9g")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("motion", [swept, shaken])
def test_one_file_of_a_sweep_or_of_random_vibration_is_recognised_and_identified(motion, tmp_path, rng):
    x = motion(rng)
    # the equation is integrated at ten times the rate of the file, where a hold between samples has no delay
    fine = signal.resample_poly(x, 10, 1)
    y = second_order(fine, 800.0, 0.6, 10.0 * RATE_HZ)[::10]
    path = written(tmp_path / "shaker.csv", x, y, rng, 2e-4)
    proposed = inspect([path]).document
    assert "--procedure sweep --map time=1,reference=2,z=3" in proposed["command"]
    assert proposed["open"] == []
    layout = RecordingLayout({"time": "1", "reference": "2", "z": "3"}, {})  # as the printed command has them
    document = import_waveforms([path], "sweep", None, "S1", layout, str(tmp_path / "archive"))
    figures = {one["figure"]: one for one in document["figures"]}
    for name, true in (("sweep_natural_hz", 800.0), ("sweep_damping", 0.6)):
        assert figures[name]["identified"]
        assert abs(figures[name]["value"] - true) < max(2.0 * figures[name]["uncertainty"], 0.005 * true)
    assert "a flatness belongs to a band; set flat_to_hz" in figures["sweep_flatness_percent"]["note"]
    assert "no static scale and no nominal_scale" in figures["sweep_sensitivity_percent"]["note"]


def shock_file(path, rng, duration_s=1e-3, *, rings=(9000.0, 0.7)):
    t = np.arange(int(0.2 * 50_000.0)) / 50_000.0
    pulse = 480.0 * np.sin(np.pi * (t - 0.05) / duration_s) * ((t >= 0.05) & (t < 0.05 + duration_s))
    base = pulse + 0.2 * rng.standard_normal(t.size)
    frame = {"t [s]": t, "dut [g]": second_order(base, *rings, 50_000.0), "ref [g]": base}
    pd.DataFrame(frame).to_csv(path, index=False, float_format="%.8g")
    return path


def shocked(path, *, part=None, **columns):
    """The document of the import of a shock; ``columns`` : by the meaning, beside those of time and output."""
    layout = RecordingLayout({"time": "t [s]", "z": "dut [g]"} | columns, {})
    return import_waveforms([path], "shock", part, "S1", layout, str(path.parent / "archive"))


@pytest.mark.parametrize("duration_ms", mostly_slow([0.5, 11.0], 11.0))
def test_a_pulse_is_found_by_itself_and_another_duration_than_its_own_is_refused(duration_ms, tmp_path, rng):
    path = shock_file(tmp_path / "drop.csv", rng, duration_s=1e-3 * duration_ms)
    assert "--procedure shock" in inspect([path]).document["command"]
    document = shocked(path, reference="ref [g]")
    figures = {one["figure"]: one["value"] for one in document["figures"]}
    assert figures["shock_peak_g"] == pytest.approx(480.0, rel=0.015)
    assert figures["shock_duration_ms"] == pytest.approx(duration_ms, rel=0.03)
    assert figures["shock_velocity_m_s"] == pytest.approx(2.0 * 480.0 * 9.80665 * 1e-3 * duration_ms / np.pi, rel=0.015)
    assert any(line.startswith("pulse: reference 4") for line in document["text"])
    part = tmp_path / "part.toml"
    part.write_text(f"duration_ms = {3.0 * duration_ms}\n")
    with pytest.raises(DataRejected, match=rf"duration_ms is {3.0 * duration_ms:g}, the pulse lasts [\d.]+ ms"):
        shocked(path, part=part, reference="ref [g]")


def test_a_drive_in_volts_that_steps_is_proposed_as_a_step_response(tmp_path, rng):
    drive = np.where(np.arange(4000) > 1000, 1.0, 0.0)
    path = written(tmp_path / "step.csv", drive, second_order(drive, 200.0, 0.6, RATE_HZ), rng, 2e-4)
    path.write_text(path.read_text().replace("ref [m/s^2]", "drive [V]"))
    proposed = inspect([path]).document["command"]
    assert "--procedure step_response --map time=1,reference=2,z=3" in proposed


def test_a_sensor_alone_has_its_pulse_and_no_sensitivity_and_a_channel_that_no_test_reads_is_refused(tmp_path, rng):
    path = shock_file(tmp_path / "alone.csv", rng)
    document = shocked(path)
    figures = {one["figure"]: one for one in document["figures"]}
    assert figures["shock_peak_g"]["value"] == pytest.approx(480.0, rel=0.015)
    assert "without a reference" in figures["shock_sensitivity_percent"]["note"]
    with pytest.raises(WrongUse, match=r"--map reference_w=…: no channel of a recording; did you mean reference_"):
        shocked(path, reference_w="dut [g]")


def test_two_places_of_a_board_are_told_to_be_no_comparison(tmp_path, rng):
    path = shock_file(tmp_path / "board.csv", rng, rings=(700.0, 0.05))  # between the two
    document = shocked(path, reference="ref [g]")
    sensitivity = next(one for one in document["figures"] if one["figure"] == "shock_sensitivity_percent")
    assert not sensitivity["identified"]
    assert "two places of a structure are no comparison" in sensitivity["note"]
    assert not any("missing effect" in line for line in document["text"])
