"""HDF5: a dataset for each channel in a group for each clock, with the attributes ``unit`` and ``sample_interval_s``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipelines.export.waveforms.channel import Channel
from schemas.library import library

NAME, SUFFIX, ONE_CLOCK = "hdf5", ".h5", True


def write(channels: Sequence[Channel], path: Path) -> None:
    """Write the channels and ``time`` in s."""
    h5py = library("h5py", "hdf5", "waveforms: an HDF5 file")
    with h5py.File(path, "w") as file:
        file.create_dataset("time", data=channels[0].time).attrs["unit"] = "s"
        for one in channels:
            stored = file.create_dataset(one.name, data=one.values)
            stored.attrs["unit"], stored.attrs["sample_interval_s"] = one.unit, one.interval_s
