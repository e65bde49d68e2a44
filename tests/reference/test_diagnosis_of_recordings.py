"""Real recordings with known hidden effects: what is missing is named, and the error falls to what was published."""

import numpy as np
import pytest

from pipelines.diagnosis.compare import compare
from pipelines.diagnosis.diagnose import diagnose
from pipelines.importers import exchange, files

MM_S2 = 9.80665e-3
"""One µg in mm/s²."""

CUBIC = ("bias", "bias_temperature", "bias_temperature_quadratic", "bias_temperature_cubic")


@pytest.fixture
def chamber(shared_data):
    """The ramp of a chamber cycle, every reading a dwell of its own: one unit, one pose, about 2 Hz."""
    table, _ = files.read(shared_data / "chamber-cycle" / "imu_raw_data.csv")
    out = table[["imu.acc.x", "imu.acc.y", "imu.acc.z"]].set_axis(["out_x", "out_y", "out_z"], axis=1)
    time = (table["timestamp"] - table["timestamp"].iloc[0]) * 1e-6
    frame = out.assign(dwell=range(len(out)), time_s=time, unit_C=table["imu.temperature"], force_x=0.0, force_y=0.0)
    return exchange.checked(frame.assign(unit="IMU", n=1, out_unit="m/s^2", force_z=-1.0), where="chamber cycle")


def test_a_lag_fitted_per_axis_takes_the_chamber_cycle_to_the_published_residuals(chamber):
    chamber = chamber.iloc[::2].assign(dwell=range(len(chamber.iloc[::2])))  # at 1 Hz a lag of minutes is as well seen
    before = compare(chamber, CUBIC)["by_axis"]
    assert [MM_S2 * before[a] for a in "xyz"] == pytest.approx([6.4, 17.3, 44.2], rel=0.01)
    comparison = compare(chamber, [*CUBIC, "thermal_lag"])
    left = [MM_S2 * comparison["by_axis"][a] for a in "xyz"]
    assert left[0] <= 3.8
    assert left[1] <= 4.9
    assert left[2] <= 11.6
    assert len(comparison["nonlinear"]["thermal_lag"]["tau"]) == 3


@pytest.mark.slow
def test_the_rate_of_temperature_drives_the_chamber_cycle_and_a_lag_is_named(chamber):
    diagnosis = diagnose(chamber, effects=CUBIC)
    assert not diagnosis["adequate"]
    assert "temperature_rate" in {w["driver"] for w in diagnosis["where"]}
    assert {"thermal_lag", "thermal_rate", "thermal_hysteresis"} & set(diagnosis["recommended"])


@pytest.mark.slow
def test_the_temperature_offset_of_a_worn_unit_is_found_missing(shared_data):
    table, _ = files.read(shared_data / "worn-unit" / "static_windows.csv.gz")
    names = {"meanx": "out_x", "meany": "out_y", "meanz": "out_z", "sdx": "sd_x", "sdy": "sd_y", "sdz": "sd_z"}
    frame = table.rename(columns={**names, "temperature": "unit_C"}).drop(columns="window")
    dwell = np.arange(len(frame))
    frame = frame.assign(unit="worn", dwell=dwell, time_s=10.0 * dwell, n=1, out_unit="g")
    diagnosis = diagnose(exchange.checked(frame, where="worn unit"), effects=["bias", "scale"])
    assert not diagnosis["adequate"]
    named = {e for c in diagnosis["classes"] for e in c["effects"]}
    assert "bias_temperature" in named
