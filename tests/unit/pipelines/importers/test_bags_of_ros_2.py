"""Bags of ROS 2 as another program writes them: topics, the clock of the headers, and what is refused with a remedy."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from each import each

from pipelines.importers import files
from schemas.errors import DataRejected, WrongUse

IMU = "sensor_msgs/msg/Imu"
START = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The .db3 of a bag with an accelerometer and a text topic; the headers' clock is 5 ms before that of the recorder."""
    pytest.importorskip("rosbags")
    folder = tmp_path_factory.mktemp("bags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    vector, zero = kinds["geometry_msgs/msg/Vector3"], np.zeros(9)
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as out:
        imu = out.add_connection("/imu/data", IMU, typestore=store)
        told = out.add_connection("/told", "std_msgs/msg/String", typestore=store)
        for k in range(200):
            at = START + 10_000_000 * k
            stamp = kinds["builtin_interfaces/msg/Time"](sec=at // 10**9, nanosec=at % 10**9)
            message = kinds[IMU](
                header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="imu"),
                orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0), orientation_covariance=zero,
                angular_velocity=vector(x=0.0, y=0.0, z=0.1), angular_velocity_covariance=zero,
                linear_acceleration=vector(x=0.01 * k, y=0.0, z=9.81), linear_acceleration_covariance=zero,
            )  # fmt: skip
            out.write(imu, at + 5_000_000, store.serialize_cdr(message, IMU))
        out.write(told, START, store.serialize_cdr(kinds["std_msgs/msg/String"](data="begin"), "std_msgs/msg/String"))
    return next((folder / "bag").glob("*.db3"))


def test_a_topic_is_read_with_the_clock_of_its_headers_also_with_a_journal_beside_the_bag(
    bag: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(bag, tmp_path))
    with pytest.raises(WrongUse, match=r"2 groups .*'/imu/data' \(200 samples\), '/told' \(1 samples\)"):
        files.read_content(path)
    content, source = files.read_content(path, "/imu/data")
    assert source.form == "rosbag2"
    np.testing.assert_allclose(content.table["time"], 0.01 * np.arange(200), atol=1e-9)
    np.testing.assert_allclose(content.table["linear_acceleration.x"], 0.01 * np.arange(200))
    assert content.units["linear_acceleration.x"] == "m/s^2"
    assert "time of the headers" in content.remarks[0]
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode = WAL")
    assert len(files.read_content(path, "/imu/data")[0].table) == 200


CHANGES = {
    "UPDATE messages SET data = x'28b52ffd00'": "its messages are compressed",
    "UPDATE topics SET type = 'own_msgs/msg/Unknown'": "no definition of its messages",
    "UPDATE messages SET data = x'0001'": "cannot be read",
    "DROP TABLE messages": "without the tables of a bag",
}


@each(CHANGES)
def test_a_bag_that_cannot_be_read_is_refused_with_what_to_do(change: str, bag: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(bag, tmp_path))
    with closing(sqlite3.connect(path)) as database:
        database.execute(change)
        database.commit()
    with pytest.raises(DataRejected) as caught:
        files.read_content(path, "/imu/data")
    assert CHANGES[change] in str(caught.value)
    assert "\n" not in str(caught.value)
    assert any(word in str(caught.value) for word in ("convert", "export"))
