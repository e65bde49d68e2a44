"""Messages of ROS as columns: nested fields by their path, arrays by element, the time of the header where it is stamped."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content
from schemas.errors import DataRejected

MOST_ELEMENTS = 16
"""Of an array; longer ones, such as covariances of poses and images, are left out."""
MOST_DEPTH = 8
STAMP = "header.stamp"
UNITS = {"linear_acceleration": "m/s^2", "angular_velocity": "rad/s", "magnetic_field": "T", "temperature": "degC"}
"""Units of fields of sensor_msgs, by the first part of their path (REP 103)."""


def flattened(message: Any, depth: int = 0) -> dict[str, float]:
    """The numbers of a message by the path of their fields; the time of its header is :data:`STAMP`, whole nanoseconds."""
    row: dict[str, float] = {}
    for name, value in _fields(message).items():
        if name == "header" and depth == 0:
            stamp = _fields(_fields(value).get("stamp"))
            seconds = stamp.get("sec", stamp.get("secs"))
            if seconds is not None:
                row[STAMP] = 10**9 * int(seconds) + int(stamp.get("nanosec", stamp.get("nsecs", 0)))
        elif isinstance(value, bool | int | float | np.number):
            row[name] = float(value)
        elif isinstance(value, np.ndarray) or (isinstance(value, Sequence) and not isinstance(value, str | bytes)):
            if 0 < len(value) <= MOST_ELEMENTS:
                row |= {f"{name}[{k}]": float(v) for k, v in enumerate(value) if isinstance(v, int | float | np.number)}
        elif depth < MOST_DEPTH:
            row |= {f"{name}.{inner}": number for inner, number in flattened(value, depth + 1).items()}
    return row


def _fields(message: Any) -> dict[str, Any]:
    """The fields of a message, whatever class a library has made for it."""
    if isinstance(message, Mapping):
        return {str(key): value for key, value in message.items()}
    if is_dataclass(message):
        return {
            field.name: getattr(message, field.name) for field in fields(message) if not field.name.startswith("__")
        }
    names = getattr(message, "__slots__", None) or getattr(message, "__dict__", {})
    return {str(name): getattr(message, str(name)) for name in names if not str(name).startswith("_")}


def content_of(rows: Sequence[tuple[int, dict[str, float]]], kind: str, name: str, topic: str) -> Content:
    """The columns of a topic with ``time`` in s since its first message: that of the headers, else of the recorder.

    Parameters
    ----------
    rows : time of the recorder, ns, and numbers of each message
    kind : type of the messages
    """
    if not rows or not any(numbers for _, numbers in rows):
        raise DataRejected(
            f"{name}: topic {topic} ({kind}) has no numbers, a topic with numbers is needed; name another with --set group=NAME"
        )
    stamps = [int(numbers.pop(STAMP, 0)) for _, numbers in rows]
    stamped = min(stamps) > 0
    # ns since 1970: no float holds them
    when = np.array(stamps if stamped else [logged for logged, _ in rows], dtype=np.int64)
    order = np.argsort(when, kind="stable")
    table = pd.DataFrame([rows[k][1] for k in order])
    table.insert(0, "time", 1e-9 * (when[order] - when[order][0]))
    units = {"time": "s"} | {
        str(column): unit for column in table for begin, unit in UNITS.items() if str(column).split(".")[0] == begin
    }
    source = "headers of the messages" if stamped else "recorder"
    return Content(table, (f"topic {topic} ({kind}), time of the {source}",), units)
