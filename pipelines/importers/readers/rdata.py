"""R's files (.rda, .RData, .rds): data frames as columns."""

import bz2
import lzma
from typing import Any, cast

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, chosen
from pipelines.importers.unpacking import MOST_BYTES, refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "rdata", "R data (.rda, .RData, .rds)", "r", 80
_SAVED = (b"RDX2\n", b"RDX3\n", b"RDA2\n", b"RDA3\n")
_SINGLE = (b"X\n\x00\x00\x00", b"A\n2\n", b"A\n3\n")
_BZIP2, _XZ = b"BZh", b"\xfd7zXZ\x00"
REMEDY = "save the data frame again with save(…), or export it with write.csv"


def recognised(data: bytes) -> bool:
    """Whether the file begins as R's saved objects do, also packed by bzip2 or xz (gzip is unpacked before)."""
    try:
        return _unpacked(data[: 2**20], 64).startswith((*_SAVED, *_SINGLE))
    except (OSError, lzma.LZMAError, EOFError):
        return False


def _unpacked(data: bytes, most: int) -> bytes:
    """At most so many bytes of what bzip2 or xz packed; bytes of another format as they are."""
    if not data.startswith((_BZIP2, _XZ)):
        return data
    unpack = bz2.BZ2Decompressor() if data.startswith(_BZIP2) else lzma.LZMADecompressor(memlimit=2**28)
    return unpack.decompress(data, most)


def read(name: str, data: bytes, group: str) -> Content:
    """The data frame of a file; several are groups to choose from."""
    rdata = library("rdata", EXTRA, f"{name}: a file of R")
    with foreign(f"{name}: a packed file of R that does not unpack", "copy it again"):
        plain = _unpacked(data, MOST_BYTES + 1)
    refuse_larger(len(plain), len(data), name)
    suffix = ".rds" if plain.startswith(_SINGLE) else ".rda"
    classes = {**rdata.conversion.DEFAULT_CLASS_MAP, "integer64": _long_integers}
    classes["POSIXct"] = lambda values, _: pd.to_datetime(
        np.asarray(values, dtype=float), unit="s"
    )  # s since 1970, UTC
    with foreign(f"{name}: a file of R that cannot be read", REMEDY):
        parsed = rdata.parser.parse_data(plain, extension=suffix)
        found = rdata.conversion.convert(parsed, classes, default_encoding="utf-8")
    objects = found if isinstance(found, dict) else {"frame": found}
    frames = {
        str(key): frame
        for key, frame in objects.items()
        if isinstance(frame, pd.DataFrame) and len(cast("Any", frame.columns))
    }
    if not frames:
        raise DataRejected(f"{name}: no data frame in this file of R, one is needed; {REMEDY}")
    frame = frames[chosen([(key, len(frame)) for key, frame in frames.items()], group, name)]
    return Content(pd.DataFrame({str(column): _plain_column(frame[column]) for column in frame.columns}))


def _long_integers(values: Any, attributes: Any) -> Any:
    """The integers of the package bit64: 64 bits, saved as if they were floating-point numbers; NA is the lowest of them."""
    integers = np.asarray(values, dtype=float).view(np.int64)
    gone = integers == np.iinfo(np.int64).min
    return np.where(gone, np.nan, integers.astype(float)) if gone.any() else integers


def _plain_column(values: pd.Series) -> pd.Series:
    """A column with numpy's types: numbers with gaps as floating-point numbers, factors as their texts."""
    values = values.reset_index(drop=True)
    if isinstance(values.dtype, pd.CategoricalDtype | pd.StringDtype):
        return values.astype("str")
    if not pd.api.types.is_extension_array_dtype(values) or not pd.api.types.is_numeric_dtype(values):
        return values
    if values.isna().any():
        return values.astype("float64")
    return values.astype("bool" if str(values.dtype) == "boolean" else "int32")
