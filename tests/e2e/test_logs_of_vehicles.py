"""Logs of autopilots, robots and vehicles, and spreadsheets, from the file to a model."""

from pathlib import Path

import numpy as np
import pytest
from in_process import command

from pipelines.importers import files
from pipelines.importers.triads import triad
from schemas.errors import DataRejected, WrongUse

pytestmark = pytest.mark.usefixtures("no_next_measurement")

FACES = 9.81 * np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
IMU = """\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
geometry_msgs/Vector3 linear_acceleration
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def six_faces(count: int = 400) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.repeat(FACES, count, 0) * 1.01 + [0.1, -0.05, 0.02] + 0.02 * rng.normal(size=(6 * count, 3))


def robot(path: Path) -> None:
    """A recording of ROS 2 with two topics; the headers' clock is not that of the recorder."""
    from mcap_ros2.writer import Writer

    with path.open("wb") as file, Writer(file) as out:
        imu = out.register_msgdef("sensor_msgs/msg/Imu", IMU)
        other = out.register_msgdef("own_msgs/msg/State", "string text")
        start = 1_700_000_000_000_000_000
        for k, force in enumerate(six_faces()):
            stamp = start + 10_000_000 * k
            message = {
                "header": {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": "imu"},
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
                "orientation_covariance": [0.0] * 9,
                "angular_velocity": {"x": 0.01, "y": 0.0, "z": 0.0},
                "linear_acceleration": dict(zip("xyz", map(float, force), strict=True)),
            }
            late = stamp + 3_000_000 * (k % 2)
            out.write_message("/imu/data", imu, message, late, late)
            if k % 100 == 0:
                out.write_message("/state", other, {"text": "on"}, late, late)


@pytest.mark.slow
def test_a_recording_of_a_robot_becomes_a_model(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot(tmp_path / "imu.mcap")
    with pytest.raises(WrongUse, match=r"2 groups .*'/imu/data' \(2400 samples\), '/state' \(24 samples\)"):
        files.read_content(tmp_path / "imu.mcap")
    content, _ = files.read_content(tmp_path / "imu.mcap", "/imu/data")
    np.testing.assert_allclose(content.table["time"], 0.01 * np.arange(2400), atol=1e-9)
    assert content.units["linear_acceleration.x"] == "m/s^2"
    with pytest.raises(DataRejected, match=r"/state .* has no numbers"):
        files.read_content(tmp_path / "imu.mcap", "/state")
    done = command(["improve", "imu.mcap", "--set", "group=/imu/data"])
    assert done.returncode in {0, 1}, done.stderr
    assert "x: bias 0.10" in done.stdout, done.stdout


def test_positions_logged_back_to_back_are_faces_by_their_own_names_and_an_array_of_three_is_a_triad(
    tmp_path, monkeypatch
):
    """Their labels were those of dwells, which no import of such a record has."""
    monkeypatch.chdir(tmp_path)
    table = np.column_stack([0.01 * np.arange(2400), six_faces()])
    np.savetxt("six.csv", table, delimiter=",", header="time,ax,ay,az", comments="", fmt="%.5f")
    done = command(["improve", "six.csv"])
    assert done.returncode in {0, 1}, done.stderr
    assert "x: bias 0.10" in done.stdout
    outputs = six_faces(30)
    columns = {f"accelerometer_m_s2[{k}]": outputs[:, k] for k in range(3)} | {"gyro_rad[0]": np.arange(180.0)}
    assert triad(columns, {}).names == tuple(f"accelerometer_m_s2[{k}]" for k in range(3))
