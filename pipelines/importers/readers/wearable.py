"""Worn loggers: CWA of Axivity, GT3X of ActiGraph, .bin of GENEActiv; acceleration with the temperature beside it."""

import io
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content
from pipelines.importers.limited_process import reserving
from pipelines.importers.unpacking import refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "wearable", "CWA, GT3X and GENEActiv", "wearable", 26
CWA, GENEACTIV, PACKED = b"MD\xfc\x03", b"Device Identity", b"PK\x03\x04"
PARTS = (b"info.txt", b"log.bin")
"""Of a GT3X file, which is a zip archive."""
RESERVED = 4_250_000_000
"""Bytes of address space that the library reserves for every GT3X file, whatever it holds."""
FROM_PARAMETERS = "device_feature_enabled"
"""What the library tells of a GT3X file whose parameters it has read."""
REMEDY = "download it again from the device, or export it as CSV with its maker's program"
COLUMNS = {"acceleration": ("g", "acc"), "gyroscope": ("deg/s", "gyr")}


def recognised(data: bytes) -> bool:
    """Whether the file is of one of the three formats."""
    return data.startswith((CWA, GENEACTIV)) or (data.startswith(PACKED) and all(part in data for part in PARTS))


def read(name: str, data: bytes, group: str) -> Content:
    """Acceleration in g, and what is beside it: rate of turn in deg/s, and temperature read at the times of acceleration."""
    actfast = library("actfast", EXTRA, f"{name}: a record of a worn logger")
    if data.startswith(PACKED):
        with foreign(f"{name}: a GT3X file that does not unpack", REMEDY):
            refuse_larger(sum(part.file_size for part in zipfile.ZipFile(io.BytesIO(data)).infolist()), len(data), name)
    with tempfile.TemporaryDirectory() as folder:  # the library opens a file
        path = Path(folder) / "record"
        path.write_bytes(data)
        packed = data.startswith(PACKED)
        with foreign(f"{name}: a record of a worn logger that cannot be read", REMEDY), reserving(RESERVED * packed):
            found = actfast.read(path)
    series: dict[str, dict[str, Any]] = found["timeseries"]
    fast = next((part for part in series.values() if len(part.get("acceleration", ()))), None)
    if fast is None:
        raise DataRejected(
            f"{name}: {found['format']}: no samples of acceleration were found, some are needed; "
            "export it as CSV with its maker's program (ActiGraph's packets ACTIVITY2 are not read)"
        )
    if packed and FROM_PARAMETERS not in found["metadata"]:  # the library would assume a rate and a scale
        raise DataRejected(
            f"{name}: {found['format']}: no packet of parameters, which state rate and scale; {REMEDY.partition(', or ')[2]}"
        )
    when = np.asarray(fast["datetime"], dtype=np.int64)  # ns since 1970: no float holds them
    columns: dict[str, Any] = {"time": 1e-9 * (when - when[0])}
    units = {"time": "s"}
    for kind, (unit, short) in COLUMNS.items():
        if kind in fast:
            columns |= {f"{short}_{axis}": fast[kind][:, k].astype(np.float64) for k, axis in enumerate("xyz")}
            units |= {f"{short}_{axis}": unit for axis in "xyz"}
    slow = next((part for part in series.values() if len(part.get("temperature", ()))), None)
    remarks = [f"{found['format']}: acceleration in g, as the logger converts it"]
    if slow is not None:
        at = 1e-9 * (np.asarray(slow["datetime"], dtype=np.int64) - when[0])
        columns["temperature"] = np.interp(columns["time"], at, slow["temperature"].astype(np.float64))
        units["temperature"] = "degC"
        remarks.append(f"temperature: {len(at)} readings, linear in between")
    return Content(pd.DataFrame(columns), tuple(remarks), units)
