"""enDAQ and Mide recorders (.ide): the subchannels of one channel, each channel with a clock of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, chosen
from pipelines.importers.temporary_file import as_file
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "ide", "enDAQ IDE", "ide", 70
MAGIC = b"\x1a\x45\xdf\xa3"  # EBML
DOCTYPE = b"mide"
REMEDY = "copy it again, or export the channel as CSV"


def recognised(data: bytes) -> bool:
    """Whether the file is EBML with the document type of these recorders."""
    return data.startswith(MAGIC) and DOCTYPE in data[:256].lower()


def read(name: str, data: bytes, group: str) -> Content:
    """The subchannels of one channel beside `time` in s, calibrated by the file's own coefficients."""
    idelib = library("idelib", EXTRA, f"{name}: an IDE recording")
    broken = f"{name}: an IDE recording that cannot be read"
    # the library's importFile opens the file itself, and leaves it open where the file is broken
    with as_file(data, ".ide") as path, path.open("rb") as stream:
        with foreign(broken, REMEDY):
            dataset = idelib.importer.openFile(stream, quiet=True)
            idelib.importer.readData(dataset)
            channels = {f"{key}": channel for key, channel in dataset.channels.items()}
            lengths = {key: len(channel.getSession()) for key, channel in channels.items()}
        filled = {key: n for key, n in lengths.items() if n > 0}
        if not filled:
            raise DataRejected(f"{name}: no channel with samples in this IDE recording, one is needed; check the file")
        with foreign(broken, REMEDY):
            titles = {f"{key} {channels[key].name}".strip(): key for key in filled}
        titles = {**titles, **({group: group} if group in filled else {})}
        title = chosen([(t, filled[k]) for t, k in titles.items()], group, name)
        with foreign(broken, REMEDY):
            return _content(channels[titles[title]])


def _content(channel: Any) -> Content:
    values = np.asarray(channel.getSession().arraySlice(), dtype=np.float64)
    columns, units = {"time": values[0] * 1e-6}, {"time": "s"}
    for number, one in enumerate(channel.subchannels):
        label = str(one.name) if str(one.name) not in columns else f"{one.name} ({number + 1})"
        columns[label] = values[1 + number]
        units[label] = str((one.units or ("", ""))[1] or "")
    return Content(pd.DataFrame(columns), ("calibrated by the coefficients in the file",), units)
