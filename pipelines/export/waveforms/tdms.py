"""TDMS: a group for each clock, channels with ``wf_increment``, ``wf_start_offset`` and ``unit_string``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipelines.export.waveforms.channel import Channel
from schemas.library import library

NAME, SUFFIX, ONE_CLOCK = "tdms", ".tdms", False


def write(channels: Sequence[Channel], path: Path) -> None:
    """Write the channels."""
    nptdms = library("nptdms", "tdms", "waveforms: a TDMS file")
    made = [
        nptdms.ChannelObject(
            one.group,
            one.name,
            one.values,
            {
                "wf_increment": one.interval_s,
                "wf_start_offset": one.start_s,
                "wf_samples": len(one.values),
                "unit_string": one.unit,
            },
        )
        for one in channels
    ]
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment([nptdms.RootObject({}), *made])
