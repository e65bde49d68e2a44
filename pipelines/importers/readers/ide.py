"""enDAQ and Mide recorders (.ide): the subchannels of one channel, each channel with a separate clock."""

import io
import math
import re
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, chosen
from schemas.errors import DataRejected
from schemas.foreign import foreign, shown
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "ide", "enDAQ IDE", "ide", 70
MAGIC = b"\x1a\x45\xdf\xa3"  # EBML
DOCTYPE = b"mide"
_QUOTIENT = re.compile(
    r"\s*([+-]?[0-9.]{1,20}(?:[eE][+-]?\d{1,3})?)\s*(?:/\s*([+-]?[0-9.]{1,20}(?:[eE][+-]?\d{1,3})?))?\s*"
)
REMEDY = "copy it again, or export the channel as CSV"


def recognised(data: bytes) -> bool:
    """Whether the file is EBML with the document type of these recorders."""
    return data.startswith(MAGIC) and DOCTYPE in data[:256].lower()


def read(name: str, data: bytes, group: str) -> Content:
    """The subchannels of one channel beside `time` in s, calibrated by the file's own coefficients."""
    idelib = library("idelib", EXTRA, f"{name}: an IDE recording")
    # the library's importFile opens the file itself, and leaves it open where the file is broken
    with io.BytesIO(data) as stream, foreign(f"{name}: an IDE recording that cannot be read", REMEDY):
        # the library evaluates these strings as Python: 9**99**99 never returns
        idelib.parsers.valEval = partial(_number, where=name)
        dataset = idelib.importer.openFile(stream, quiet=True, name=name)
        idelib.importer.readData(dataset)
        channels = {f"{key}": channel for key, channel in dataset.channels.items()}
        lengths = {key: len(channel.getSession()) for key, channel in channels.items()}
        titles = {f"{key} {channels[key].name}".strip(): key for key, count in lengths.items() if count > 0}
        if group in titles.values():
            titles[group] = group
        counts = [(title, lengths[key]) for title, key in titles.items()]
        title = chosen(counts, group, name, "no channel with samples in this IDE recording")
        return _content(channels[titles[title]])


def _number(text: str | bytes, where: str) -> float:
    """A sample rate or a time scale, as the recorders write it: a number, or number/number such as 1.0/32768."""
    plain = text.decode("utf-8", "replace") if isinstance(text, bytes | bytearray) else str(text)
    value = float("nan")
    with suppress(ValueError, ZeroDivisionError):
        if match := _QUOTIENT.fullmatch(plain):
            value = float(match[1]) / float(match[2] or 1.0)
    if not math.isfinite(value):
        raise DataRejected(
            f"{where}: an IDE recording with the rate or time scale '{shown(plain)}', a number or number/number is needed; "
            f"{REMEDY}"
        )
    return value


def _content(channel: Any) -> Content:
    values = np.asarray(channel.getSession().arraySlice(), dtype=np.float64)
    columns, units = {"time": values[0] * 1e-6}, {"time": "s"}
    for number, subchannel in enumerate(channel.subchannels):
        label = str(subchannel.name) if str(subchannel.name) not in columns else f"{subchannel.name} ({number + 1})"
        columns[label] = values[1 + number]
        units[label] = str((subchannel.units or ("", ""))[1] or "")
    return Content(pd.DataFrame(columns), ("calibrated by the coefficients in the file",), units)
