"""MDF files of measurement systems in vehicles (.mf4, .mdf, .dat): the channels of one group with their master."""

import io
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, begins_with, chosen
from pipelines.importers.unpacking import refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "mdf4", "MDF 3 and 4 (.mf4, .mdf)", "mdf", 64
recognised = begins_with(b"MDF     ")
REMEDY = "copy it again, or export the group as CSV"


def read(name: str, data: bytes, group: str) -> Content:
    """The channels of one channel group with numbers; `time` in s is its master channel."""
    asammdf = library("asammdf", EXTRA, f"{name}: an MDF file")
    with foreign(f"{name}: an MDF file that cannot be read", REMEDY), asammdf.MDF(io.BytesIO(data)) as file:
        counts = {
            f"{number} {entry.channel_group.acq_name}".strip(): (number, int(entry.channel_group.cycles_nr))
            for number, entry in enumerate(file.groups)
            if entry.channel_group.cycles_nr
        }
        refuse_larger(
            8 * sum(len(entry.channels) * int(entry.channel_group.cycles_nr) for entry in file.groups), len(data), name
        )
        by_number = {str(number): label for label, (number, _) in counts.items()}
        samples = [(label, count) for label, (_, count) in counts.items()]
        title = chosen(samples, by_number.get(group, group), name, "no channel group with samples in this MDF file")
        signals = [_signal(file, counts[title][0], k) for k in range(len(file.groups[counts[title][0]].channels))]
    numeric = [signal for signal in signals if signal is not None]
    if not numeric:
        raise DataRejected(
            f"{name}: group '{title}' has no numeric channel, one is needed; name another with --set group=NAME"
        )
    columns: dict[str, Any] = {"time": numeric[0].timestamps}
    units: dict[str, str] = {"time": "s"}
    for signal in numeric:
        columns[str(signal.name)] = signal.samples
        units[str(signal.name)] = str(signal.unit or "")
    return Content(pd.DataFrame(columns), (), units)


def _signal(file: Any, group: int, index: int) -> Any:
    """A channel with its timestamps; None for the master, and for one without numbers."""
    if file.masters_db.get(group) == index:
        return None
    signal = file.get(group=group, index=index)
    samples = np.asarray(signal.samples)
    return signal if samples.ndim == 1 and samples.dtype.kind in "fiub" else None
