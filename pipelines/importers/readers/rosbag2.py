"""Bags of ROS 2 in SQLite (.db3): the numbers of one topic, with the time of their headers."""

import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

from pipelines.importers.content import Content, begins_with, chosen
from pipelines.importers.ros_messages import content_of, flattened
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "rosbag2", "bag of ROS 2 (.db3)", "ros", 77
recognised = begins_with(b"SQLite format 3\0")
REMEDY = "run 'ros2 bag reindex' on its folder, or convert it to MCAP with 'ros2 bag convert'"
PACKED = b"\x28\xb5\x2f\xfd"
"""Of a message that the recorder has compressed with zstd."""


def read(name: str, data: bytes, group: str) -> Content:
    """The numeric fields of one topic beside `time` in s; an array is a column for each element."""
    typesys = library("rosbags.typesys", EXTRA, f"{name}: a bag of ROS 2")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.db3"  # a bag that was not closed has a journal, which only a file may have
        path.write_bytes(data)
        with (
            foreign(f"{name}: a bag of ROS 2 that cannot be read", REMEDY),
            closing(sqlite3.connect(f"{path.as_uri()}?immutable=1", uri=True)) as bag,
        ):
            tables = {str(table) for (table,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if not {"topics", "messages"} <= tables:
                raise DataRejected(
                    f"{name}: an SQLite database without the tables of a bag of ROS 2 (topics, messages); "
                    "export the table of samples as CSV"
                )
            topics = [*bag.execute("SELECT id, name, type FROM topics ORDER BY id")]
            counts = dict(bag.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id"))
            filled = [(str(title), int(counts[number])) for number, title, _ in topics if number in counts]
            topic = chosen(filled, group, name, "no topic with messages in this bag")
            number, kind = next((number, str(type_name)) for number, title, type_name in topics if title == topic)
            store = typesys.get_typestore(typesys.Stores.LATEST)
            if "message_definitions" in tables:
                _register(typesys, store, bag)
            if kind not in store.fielddefs:
                raise DataRejected(
                    f"{name}: topic {topic}: the bag has no definition of its messages ({kind}), one is needed; "
                    "convert it to MCAP with 'ros2 bag convert' where this type is installed"
                )
            found = [
                *bag.execute("SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp", [number])
            ]
            if found[0][1].startswith(PACKED):
                raise DataRejected(
                    f"{name}: its messages are compressed, plain ones are needed; "
                    "convert it to MCAP without compression with 'ros2 bag convert'"
                )
            rows = [(int(stamp), flattened(store.deserialize_cdr(raw, kind))) for stamp, raw in found]
    return content_of(rows, kind, name, topic)


def _register(typesys: Any, store: Any, bag: sqlite3.Connection) -> None:
    """The types of messages that the bag defines and the library does not know."""
    for kind, text in bag.execute(
        "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'"
    ):
        types = typesys.get_types_from_msg(text, kind)
        store.register({type_name: fields for type_name, fields in types.items() if type_name not in store.fielddefs})
