"""Bags of ROS 1 (.bag): the numbers of one topic, with the time of their headers."""

import tempfile
from pathlib import Path

from pipelines.importers.content import Content, begins_with, chosen
from pipelines.importers.ros_messages import content_of, flattened
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "rosbag", "bag of ROS 1 (.bag)", "ros", 78
recognised = begins_with(b"#ROSBAG V2.0\n")
REMEDY = "record it again, or run 'rosbag reindex' on it"


def read(name: str, data: bytes, group: str) -> Content:
    """The numeric fields of one topic beside `time` in s; an array is a column for each element."""
    rosbags = library("rosbags.highlevel", EXTRA, f"{name}: a bag of ROS")
    with tempfile.TemporaryDirectory() as folder:  # the library opens a file
        path = Path(folder) / "record.bag"
        path.write_bytes(data)
        with foreign(f"{name}: a bag of ROS that cannot be read", REMEDY), rosbags.AnyReader([path]) as bag:
            counts = {topic: info.msgcount for topic, info in bag.topics.items() if info.msgcount}
            topic = chosen([*counts.items()], group, name, "no topic with messages in this bag")
            kind = str(bag.topics[topic].msgtype)
            connections = [connection for connection in bag.connections if connection.topic == topic]
            rows = [
                (int(stamp), flattened(bag.deserialize(raw, connection.msgtype)))
                for connection, stamp, raw in bag.messages(connections=connections)
            ]
    return content_of(rows, kind, name, topic)
