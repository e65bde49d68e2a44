"""MCAP recordings: the numbers of one topic, of ROS 1, ROS 2 or JSON messages, with the time of their headers."""

import io
import json
from collections.abc import Callable
from typing import Any

from pipelines.importers.content import Content, begins_with, chosen
from pipelines.importers.ros_messages import content_of, flattened
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "mcap", "MCAP (ROS 1, ROS 2, JSON)", "ros", 76
recognised = begins_with(b"\x89MCAP0\r\n")
REMEDY = "record it again, or run 'mcap recover' on it"


def read(name: str, data: bytes, group: str) -> Content:
    """The numeric fields of one topic beside `time` in s; an array is a column for each element."""
    reader = library("mcap.reader", EXTRA, f"{name}: an MCAP recording")
    factories = [library(f"mcap_ros{n}.decoder", EXTRA, f"{name}: an MCAP recording").DecoderFactory() for n in (1, 2)]
    with foreign(f"{name}: an MCAP recording that cannot be read", REMEDY):
        source = reader.make_reader(io.BytesIO(data), decoder_factories=[*factories, _Json()])
        summary = source.get_summary()
        if summary is None or summary.statistics is None:
            raise DataRejected(f"{name}: an MCAP recording without its summary: it was not ended; {REMEDY}")
        counts = {
            summary.channels[number].topic: count
            for number, count in summary.statistics.channel_message_counts.items()
            if count
        }
        kinds = {
            channel.topic: summary.schemas[channel.schema_id].name
            for channel in summary.channels.values()
            if channel.schema_id in summary.schemas
        }
        topic = chosen([*counts.items()], group, name, "no topic with messages in this MCAP recording")
        messages = source.iter_decoded_messages(topics=[topic])
        rows = [(int(message.log_time), flattened(decoded)) for _, _, message, decoded in messages]
    return content_of(rows, kinds.get(topic, ""), name, topic)


class _Json:
    """The decoder of messages in JSON, as the library's own decoders are called."""

    def decoder_for(self, encoding: str, schema: Any) -> Callable[[bytes], Any] | None:
        """A function from bytes to fields; None for another encoding."""
        return json.loads if encoding == "json" else None
