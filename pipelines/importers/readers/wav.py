"""WAV: channels as numbers of the converter, with the rate of the file. It states neither unit nor scale."""

import io

import numpy as np
import pandas as pd

from pipelines.importers.content import Content
from pipelines.importers.unpacking import refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign

NAME, TITLE, EXTRA, ORDER = "wav", "WAV", "", 90
REMEDY = "export it again as PCM or float, or as CSV"
_RIFF = (b"RIFF", b"RIFX", b"RF64")


def recognised(data: bytes) -> bool:
    """Whether the file is RIFF with waves in it."""
    return data[:4] in _RIFF and data[8:12] == b"WAVE"


def read(name: str, data: bytes, group: str) -> Content:
    """Channels 1, 2, … beside `time` in s."""
    from scipy.io import wavfile  # a third of a second

    with foreign(f"{name}: a WAV file that cannot be read", REMEDY):
        rate, values = wavfile.read(io.BytesIO(data))
        values = np.asarray(values)
    refuse_larger(values.nbytes, len(data), name)
    if rate <= 0 or values.size == 0:
        raise DataRejected(f"{name}: a WAV file with {values.size} samples at {rate} Hz, both are needed; {REMEDY}")
    channels = values[:, None] if values.ndim == 1 else values
    columns = {f"channel {k + 1}": channels[:, k] for k in range(channels.shape[1])}
    table = pd.DataFrame({"time": np.arange(len(channels)) / rate, **columns})
    remark = "a WAV file states neither unit nor scale: its numbers are those of the converter"
    return Content(table, (remark,), {"time": "s"}, 1.0 / rate)
