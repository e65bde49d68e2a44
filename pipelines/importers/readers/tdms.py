"""TDMS files of National Instruments: the channels of a group, with time from their waveform properties."""

import io
import logging
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, begins_with, chosen
from pipelines.importers.unpacking import refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign, shown
from schemas.library import library

_MOST_MESSAGES = 4
NAME, TITLE, EXTRA, ORDER = "tdms", "TDMS", "tdms", 60
recognised = begins_with(b"TDSm")
REMEDY = "copy it again, or export the group as CSV"


def read(name: str, data: bytes, group: str) -> Content:
    """The channels of one group; `time` in s where the file states an interval (``wf_increment``)."""
    nptdms = library("nptdms", EXTRA, f"{name}: a TDMS file")
    messages = _LibraryLog()
    with foreign(f"{name}: a TDMS file that cannot be read", REMEDY), messages.collected():
        about = nptdms.TdmsFile.read_metadata(io.BytesIO(data))
        claimed = sum(8 * len(channel) for entry in about.groups() for channel in entry.channels())
        refuse_larger(claimed, len(data), name)
        file = nptdms.TdmsFile.read(io.BytesIO(data))
        groups = {
            entry.name: [c for c in entry.channels() if len(c) and np.asarray(c[:1]).dtype.kind in "fiubM"]
            for entry in file.groups()
        }
        groups = {label: channels for label, channels in groups.items() if channels}
        counts = [(label, len(channels[0])) for label, channels in groups.items()]
        label = chosen(counts, group, name, "no channel with numbers in this TDMS file")
        content = _content(groups[label], name)
    return replace(content, remarks=(*content.remarks, *(f"message of the reader: {text}" for text in messages.texts)))


class _LibraryLog(logging.Handler):
    """What the library logs about a file: it goes into the remarks, not to standard error."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a message once."""
        text = shown(record.getMessage(), 160)
        if text not in self.texts and len(self.texts) < _MOST_MESSAGES:
            self.texts.append(text)

    @contextmanager
    def collected(self) -> Generator[None]:
        """A block in which the library's log comes here."""
        names = {"nptdms", *(name for name in logging.root.manager.loggerDict if name.startswith("nptdms"))}
        loggers = [logging.getLogger(name) for name in names]
        before = [(logger, list(logger.handlers), logger.propagate) for logger in loggers]
        try:
            for logger in loggers:
                logger.handlers, logger.propagate = [self], False
            yield
        finally:
            for logger, handlers, propagate in before:
                logger.handlers, logger.propagate = handlers, propagate


def _content(channels: list[Any], name: str) -> Content:
    longest = max(len(channel) for channel in channels)
    equal_length = [channel for channel in channels if len(channel) == longest]
    left_out = [channel.name for channel in channels if len(channel) != longest]
    columns = {channel.name: np.asarray(channel[:]) for channel in equal_length}
    units = {channel.name: str(channel.properties.get("unit_string") or "") for channel in equal_length}
    intervals = {float(c.properties["wf_increment"]) for c in equal_length if "wf_increment" in c.properties}
    interval = intervals.pop() if len(intervals) == 1 else None
    if len(intervals) >= 1:
        raise DataRejected(
            f"{name}: channels of one group with several intervals ({', '.join(f'{i:g} s' for i in sorted(intervals))}), "
            "one is needed; export them apart"
        )
    if interval is not None and interval > 0.0 and "time" not in columns:
        start = float(equal_length[0].properties.get("wf_start_offset") or 0.0)
        columns = {"time": start + interval * np.arange(longest), **columns}
        units["time"] = "s"
    remarks = (f"channels of another length were left out: {', '.join(left_out[:6])}",) if left_out else ()
    return Content(pd.DataFrame(columns), remarks, units, interval)
