"""miniSEED of seismometers and accelerometers (FDSN): the channels of one station, with time from their records."""

from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, chosen
from pipelines.importers.unpacking import refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "miniseed", "miniSEED", "seismic", 82
VERSION_3 = b"MS\x03"
QUALITIES = b"DRQM"
REMEDY = "request it again, or export the channels as CSV"


def recognised(data: bytes) -> bool:
    """Whether the file begins with a record of miniSEED 3, or of 2: six digits and a quality."""
    head = data[:8]
    return data.startswith(VERSION_3) or (
        len(head) == 8 and head[:6].isdigit() and head[6:7] in QUALITIES and head[7:8] in b" \0"
    )


def read(name: str, data: bytes, group: str) -> Content:
    """The channels of one station and band as columns, in counts; `time` in s. Segments become one record with gaps."""
    pymseed = library("pymseed", EXTRA, f"{name}: a miniSEED file")
    with foreign(f"{name}: a miniSEED file that cannot be read", REMEDY):
        traces = pymseed.MS3TraceList.from_buffer(bytearray(data), unpack_data=True)
        parts = [(str(trace.sourceid), segment) for trace in traces for segment in trace]
        parts = [(source, segment) for source, segment in parts if segment.samplecnt > 0 and segment.samprate > 0.0]
        refuse_larger(8 * sum(int(segment.samplecnt) for _, segment in parts), len(data), name)
        channels: dict[str, dict[str, list[Any]]] = {}
        for source, segment in parts:
            values = np.array(segment.datasamples, dtype=np.float64)
            rate = float(segment.samprate)
            begin = int(segment.starttime) // 1000  # µs since 1970; channels of one clock may differ by rounding
            times = begin + np.rint(1e6 * np.arange(len(values)) / rate).astype(np.int64)
            station, _, channel = source.removeprefix("FDSN:").rpartition("_")
            channels.setdefault(station, {}).setdefault(channel, []).append((times, values, rate))
    if not channels:
        raise DataRejected(f"{name}: no samples in this miniSEED file, some are needed; check the file")
    title = chosen(
        [
            (station, sum(len(v) for _, v, _ in by_channel[next(iter(by_channel))]))
            for station, by_channel in channels.items()
        ],
        group,
        name,
    )
    frames = [
        pd.Series(
            np.concatenate([v for _, v, _ in pieces]), index=np.concatenate([t for t, _, _ in pieces]), name=channel
        )
        for channel, pieces in sorted(channels[title].items())
    ]
    table = pd.concat([frame[~frame.index.duplicated()] for frame in frames], axis=1, join="inner").sort_index()
    rates = {rate for pieces in channels[title].values() for _, _, rate in pieces}
    since = table.index.to_numpy(np.int64)
    table.insert(0, "time", 1e-6 * (since - since[:1]))
    remarks = (f"station {title}; counts of the digitizer: state their unit and its sensitivity",)
    return Content(table.reset_index(drop=True), remarks, {"time": "s"}, 1.0 / rates.pop() if len(rates) == 1 else None)
