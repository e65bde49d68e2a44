"""ULog of PX4 autopilots: the fields of one message, with time from its clock."""

import io
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, begins_with, chosen
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "ulog", "ULog of PX4", "autopilot", 72
recognised = begins_with(b"ULog\x01\x12\x35")
REMEDY = "copy it again from the vehicle, or export the message with ulog2csv"
UNITS = {
    "sensor_accel": {"x": "m/s^2", "y": "m/s^2", "z": "m/s^2", "temperature": "degC"},
    "sensor_gyro": {"x": "rad/s", "y": "rad/s", "z": "rad/s", "temperature": "degC"},
    "sensor_combined": {f"accelerometer_m_s2[{k}]": "m/s^2" for k in range(3)},
    "vehicle_acceleration": {f"xyz[{k}]": "m/s^2" for k in range(3)},
}
"""Units of the fields, by message, from PX4's message definitions: a log itself states none."""


def read(name: str, data: bytes, group: str) -> Content:
    """The fields of one message with a number for each instance, such as `sensor_accel 0`; `time` in s since the start."""
    pyulog = library("pyulog", EXTRA, f"{name}: a ULog")
    with foreign(f"{name}: a ULog that cannot be read", REMEDY):
        log = pyulog.ULog(io.BytesIO(data))
        start = float(log.start_timestamp)
        messages: dict[str, Any] = {
            f"{message.name} {message.multi_id}": message for message in log.data_list if len(message.data["timestamp"])
        }
        if f"{group} 0" in messages:
            group = f"{group} 0"
        counts = [(label, len(message.data["timestamp"])) for label, message in messages.items()]
        title = chosen(counts, group, name, "no message with samples in this ULog")
        message = messages[title]
        fields = {key: np.asarray(values) for key, values in message.data.items() if key != "timestamp"}
        stamp = np.asarray(message.data["timestamp"], dtype=np.float64)
    columns = {"time": (stamp - start) * 1e-6, **fields}
    known = UNITS.get(message.name, {})
    units = {"time": "s"} | {column: unit for column, unit in known.items() if column in columns}
    dropped = tuple(f"{len(log.dropouts)} gaps in the log" for _ in log.dropouts[:1])
    return Content(pd.DataFrame(columns), dropped, units)
