"""The channels of a record of a captured run, for files of other programs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.archive import Run
from pipelines.export.waveforms.channel import Channel
from schemas.errors import WrongUse, did_you_mean
from schemas.units import AXES
from stations.devices.equipment import REFERENCE


def channels_of(run: Run, number: int, unit: str) -> list[Channel]:
    """The channels of a unit and of the reference in a record.

    Raises
    ------
    WrongUse
        The run has no samples, or no such record or unit.
    """
    if run.records is None:
        raise WrongUse(f"run {run.id}: no captured samples, they are needed; name the run of a station")
    readings = run.table("readings")
    tables = list(run.records.samples([number])) if number in set(readings["record"]) else []
    if not tables:
        last = int(readings["record"].max())
        raise WrongUse(f"run {run.id}: no record {number}, 0 to {last} are there; choose one of them")
    names = [str(name) for name in readings.loc[readings["record"] == number, "unit"]]
    serial = unit or names[0]
    if serial not in names:
        raise WrongUse(f"run {run.id}: no unit '{serial}'; {did_you_mean(serial, names)}")
    out_unit = str(readings["out_unit"].iloc[0])
    channels: list[Channel] = []
    for name, label, text, group in ((serial, serial, out_unit, "units"), (REFERENCE, "reference", "g", "reference")):
        rows = [table[table["unit"] == name] for table in tables]
        time = np.concatenate([one["time_s"].to_numpy(dtype=float) for one in rows])
        if time.size < 2:
            continue
        interval = float((time[-1] - time[0]) / (time.size - 1))
        for k, axis in enumerate(AXES):
            values = np.concatenate([one[axis].to_numpy(dtype=float) for one in rows])
            channels.append(Channel(f"{label} {axis}", text, group, values, interval, k))
    return _same_length(channels)


def _same_length(channels: list[Channel]) -> list[Channel]:
    """Channels of one interval cut to the shortest of them, so that they share a clock."""
    intervals = {round(one.interval_s, 15) for one in channels}
    if len(intervals) > 1 and max(intervals) - min(intervals) > 1e-9 * max(intervals):
        return channels
    count = min(len(one.values) for one in channels)
    first = channels[0].interval_s
    return [replace(one, values=one.values[:count], interval_s=first) for one in channels]
